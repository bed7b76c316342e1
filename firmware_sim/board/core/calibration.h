/* The calibration constants, registers 64 to 69. docs/sma-reference.md, "Calibration".
 *
 *   measured = reading * gain / 16384 + offset        output of the DAC = set current * gain / 16384 + offset
 *
 * A gain of 16384 is 1. Results are rounded down and kept within 0..65535, measured values within 0..65534; a set
 * current of 0 is always an output of 0.
 */
#ifndef CALIBRATION_H
#define CALIBRATION_H

#include <stdbool.h>
#include <stdint.h>

#define CALIBRATION_GAIN_ONE 16384
#define CALIBRATION_GAIN_LOWEST 12288 /* 0.75 */
#define CALIBRATION_GAIN_HIGHEST 20480 /* 1.25 */
#define CALIBRATION_OFFSET_HIGHEST 500 /* 50 mA or 0.5 V, also negative */

/* The record in the storage of the target: 14 bytes, no padding. `checksum` is the CRC-16 of Modbus over the six
 * constants, each with its low byte first. */
struct calibration {
    uint16_t current_gain;
    int16_t current_offset; /* 0.1 mA */
    uint16_t voltage_gain;
    int16_t voltage_offset; /* mV */
    uint16_t source_gain;
    int16_t source_offset; /* 0.1 mA */
    uint16_t checksum;
};

/* Gains of 1, offsets of 0, and the checksum of these. */
void calibration_default(struct calibration *calibration);

/* The checksum that belongs to the six constants. */
uint16_t calibration_checksum(const struct calibration *calibration);

/* True if the checksum is right and every constant lies within its limits: false for storage never written. */
bool calibration_holds(const struct calibration *calibration);

/* `count` after gain and offset. */
uint16_t calibration_apply(uint16_t count, uint16_t gain, int16_t offset);

#endif
