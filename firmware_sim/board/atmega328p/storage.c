/* ATmega328P data sheet (Microchip DS40002061), chapter "EEPROM Data Memory": a byte needs 3.4 ms, so one byte is
 * started in each turn of the main loop in which the EEPROM is ready. A record that was interrupted half-way has a wrong
 * checksum, and the board then starts with the fault self_test.
 */
#include "storage.h"

#include <avr/eeprom.h>

#include "../core/frame.h"

#define CALIBRATION_AT 0u
#define SERIAL_AT 16u
#define SERIAL_SIZE 4u

static struct calibration record;
static uint8_t remaining;

void storage_read_calibration(struct calibration *calibration) {
    eeprom_read_block(calibration, (const uint8_t *)CALIBRATION_AT, sizeof *calibration);
}

uint32_t storage_serial_number(void) {
    uint8_t bytes[SERIAL_SIZE + 2];
    uint16_t crc = FRAME_CRC_START;
    uint32_t number = 0;
    eeprom_read_block(bytes, (const uint8_t *)SERIAL_AT, sizeof bytes);
    for (uint8_t index = SERIAL_SIZE; index--;) {
        number = number << 8 | bytes[index];
    }
    for (uint8_t index = 0; index < SERIAL_SIZE; index++) {
        crc = frame_crc(crc, bytes[index]);
    }
    return crc == (bytes[4] | (uint16_t)bytes[5] << 8) ? number : 0;
}

void storage_write_calibration(const struct calibration *calibration) {
    record = *calibration;
    remaining = sizeof record;
}

void storage_step(void) {
    if (!remaining || !eeprom_is_ready()) {
        return;
    }
    uint8_t at = (uint8_t)(sizeof record - remaining--);
    eeprom_update_byte((uint8_t *)(CALIBRATION_AT + at), ((const uint8_t *)&record)[at]);
}
