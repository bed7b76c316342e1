/* INA226: data sheet TI SBOS547B, "Registers". 01h shunt voltage, 2.5 uV; 02h bus voltage, 1.25 mV; FEh 5449h. The
 * settings at power-up (4127h: 1.1 ms, no average, continuous) are the right ones.
 * MCP4725: data sheet Microchip DS22039, "Theory of Operation". Fast write of 12 bits; a read gives the status, D11..D4,
 * D3..D0, and then the EEPROM. As it leaves the factory, the output at power-up is half of the scale.
 *
 * The upper meter has the shunt, and its bus pin at the upper end of the wire; the bus pin of the lower meter is at the
 * lower end. The voltage across the wire is the difference.
 */
#include "chips.h"

#include "../core/board.h"
#include "i2c.h"
#include "range.h"

enum { UPPER = 0x40, LOWER = 0x41, SOURCE = 0x60 };
enum { SHUNT_VOLTAGE = 0x01, BUS_VOLTAGE = 0x02, MANUFACTURER = 0xFE };

#define TEXAS_INSTRUMENTS 0x5449u
#define CODES 4096u
#define HIGHEST_READING (BOARD_NO_READING - 1u)
#define WRITE_EEPROM 0x60u

/* Counts of 2.5 uV to 0.1 mA, times 2^12. */
#define CURRENT_SCALE ((25000ul * 4096 + SHUNT_MICROOHM / 2) / SHUNT_MICROOHM)
#define CODE_SCALE ((65536ul * CODES + SOURCE_FULL_SCALE / 2) / SOURCE_FULL_SCALE)

static uint16_t set_code;

static bool read_twice(uint8_t address, uint8_t pointer, uint16_t *value) {
    return i2c_read_register(address, pointer, value) || i2c_read_register(address, pointer, value);
}

bool meters_read(uint16_t *current, uint16_t *voltage) {
    uint16_t shunt, upper, lower;
    uint32_t counts;
    if (!read_twice(UPPER, SHUNT_VOLTAGE, &shunt) || !read_twice(UPPER, BUS_VOLTAGE, &upper) ||
        !read_twice(LOWER, BUS_VOLTAGE, &lower)) {
        return false;
    }
    counts = shunt & 0x8000u ? 0 : shunt * CURRENT_SCALE >> 12;
    *current = counts < HIGHEST_READING ? (uint16_t)counts : HIGHEST_READING;
    *voltage = upper > lower ? (uint16_t)((upper - lower) * 5ul / 4) : 0;
    return true;
}

bool meters_test(void) {
    uint16_t upper = 0, lower = 0;
    return read_twice(UPPER, MANUFACTURER, &upper) && read_twice(LOWER, MANUFACTURER, &lower) &&
           upper == TEXAS_INSTRUMENTS && lower == TEXAS_INSTRUMENTS;
}

bool source_set(uint16_t current) {
    uint32_t code = (current * CODE_SCALE + 0x8000u) >> 16;
    set_code = code < CODES ? (uint16_t)code : CODES - 1;
    const uint8_t bytes[] = {(uint8_t)(set_code >> 8), (uint8_t)set_code};
    return i2c_write(SOURCE, bytes, sizeof bytes) || i2c_write(SOURCE, bytes, sizeof bytes);
}

bool source_test(void) {
    uint8_t bytes[3];
    if (!i2c_read(SOURCE, bytes, sizeof bytes) && !i2c_read(SOURCE, bytes, sizeof bytes)) {
        return false;
    }
    return !(bytes[0] & 0x06) && (uint16_t)(bytes[1] << 4 | bytes[2] >> 4) == set_code;
}

void source_begin(void) {
    static const uint8_t zero[] = {WRITE_EEPROM, 0, 0};
    uint8_t bytes[5];
    source_set(0);
    if (i2c_read(SOURCE, bytes, sizeof bytes) && ((bytes[3] & 0x0F) || bytes[4])) {
        i2c_write(SOURCE, zero, sizeof zero);
    }
}
