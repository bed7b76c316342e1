/* The registers of map version 2. docs/sma-reference.md, "Map".
 *
 * BOARD_REGISTERS is the only table of them: ROW(name, address, type, access, lowest, highest). The limits are counts
 * and belong to what a client writes; a key has one value. A test compares the rows with the profile of the map.
 */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdbool.h>
#include <stdint.h>

#include "board.h"
#include "exceptions.h"

#define BOARD_DEVICE_ID 0x534Du
#define BOARD_MAP_VERSION 2u
#define BOARD_ARM_KEY 0x4152
#define BOARD_CLEAR_KEY 0x434C
#define BOARD_SAVE_KEY 0x4341

/* clang-format off */
#define BOARD_REGISTERS(ROW) \
    ROW(DEVICE_ID,           0, uint16, r,  0, 0) \
    ROW(MAP_VERSION,         1, uint16, r,  0, 0) \
    ROW(FIRMWARE_VERSION,    2, uint16, r,  0, 0) \
    ROW(SERIAL_NUMBER,       3, uint32, r,  0, 0) \
    ROW(SEQUENCE_ECHO,      16, uint16, r,  0, 0) \
    ROW(STATE,              17, uint16, r,  0, 0) \
    ROW(FAULTS,             18, uint16, r,  0, 0) \
    ROW(LIMITS,             19, uint16, r,  0, 0) \
    ROW(TEMPERATURE,        20, int16,  r,  0, 0) \
    ROW(COLD_JUNCTION,      21, int16,  r,  0, 0) \
    ROW(MEASURED_CURRENT,   22, uint16, r,  0, 0) \
    ROW(MEASURED_VOLTAGE,   23, uint16, r,  0, 0) \
    ROW(DISPLACEMENT,       24, int32,  r,  0, 0) \
    ROW(SAMPLE_COUNTER,     26, uint16, r,  0, 0) \
    ROW(UPTIME,             27, uint32, r,  0, 0) \
    ROW(ESTOP,              29, uint16, r,  0, 0) \
    ROW(SEQUENCE,           32, uint16, rw, 256, 65535) \
    ROW(HEATER_CURRENT,     33, uint16, rw, 0, 50000) \
    ROW(HEATER_ENABLE,      34, uint16, rw, 0, 1) \
    ROW(ARM,                40, uint16, w,  BOARD_ARM_KEY, BOARD_ARM_KEY) \
    ROW(FAULT_CLEAR,        41, uint16, w,  BOARD_CLEAR_KEY, BOARD_CLEAR_KEY) \
    ROW(WATCHDOG_S,         48, uint16, rw, 50, 10000) \
    ROW(TEMPERATURE_MAX,    49, uint16, rw, 0, 3000) \
    ROW(CURRENT_MAX,        50, uint16, rw, 0, 50000) \
    ROW(CURRENT_GAIN,       64, uint16, rw, CALIBRATION_GAIN_LOWEST, CALIBRATION_GAIN_HIGHEST) \
    ROW(CURRENT_OFFSET,     65, int16,  rw, -CALIBRATION_OFFSET_HIGHEST, CALIBRATION_OFFSET_HIGHEST) \
    ROW(VOLTAGE_GAIN,       66, uint16, rw, CALIBRATION_GAIN_LOWEST, CALIBRATION_GAIN_HIGHEST) \
    ROW(VOLTAGE_OFFSET,     67, int16,  rw, -CALIBRATION_OFFSET_HIGHEST, CALIBRATION_OFFSET_HIGHEST) \
    ROW(SOURCE_GAIN,        68, uint16, rw, CALIBRATION_GAIN_LOWEST, CALIBRATION_GAIN_HIGHEST) \
    ROW(SOURCE_OFFSET,      69, int16,  rw, -CALIBRATION_OFFSET_HIGHEST, CALIBRATION_OFFSET_HIGHEST) \
    ROW(CALIBRATION_SAVE,   70, uint16, w,  BOARD_SAVE_KEY, BOARD_SAVE_KEY)
/* clang-format on */

/* The addresses: REGISTER_DEVICE_ID = 0 and so on. */
#define REGISTER_ADDRESS(name, address, type, access, lowest, highest) REGISTER_##name = (address),
enum register_address { BOARD_REGISTERS(REGISTER_ADDRESS) };
#undef REGISTER_ADDRESS

bool register_exists(uint16_t address);

/* Returns the exception of writing `word`, or EXCEPTION_NONE. state_check judges the board's own limits and its state. */
uint8_t register_check(uint16_t address, uint16_t word);

/* The word at an address that exists. Call it between board_lock and board_unlock. */
uint16_t register_word(const struct board *board, uint16_t address, uint32_t now_ms);

#endif
