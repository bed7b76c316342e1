/* The calibration constants and their checksum. docs/sma-reference.md, "Calibration". */
#include "calibration.h"

#include "frame.h"

#define GAIN_BITS 14

static uint16_t add_word(uint16_t crc, uint16_t word) {
    return frame_crc(frame_crc(crc, (uint8_t)word), (uint8_t)(word >> 8));
}

uint16_t calibration_checksum(const struct calibration *calibration) {
    uint16_t crc = add_word(FRAME_CRC_START, calibration->current_gain);
    crc = add_word(crc, (uint16_t)calibration->current_offset);
    crc = add_word(crc, calibration->voltage_gain);
    crc = add_word(crc, (uint16_t)calibration->voltage_offset);
    crc = add_word(crc, calibration->source_gain);
    return add_word(crc, (uint16_t)calibration->source_offset);
}

void calibration_default(struct calibration *calibration) {
    calibration->current_gain = CALIBRATION_GAIN_ONE;
    calibration->current_offset = 0;
    calibration->voltage_gain = CALIBRATION_GAIN_ONE;
    calibration->voltage_offset = 0;
    calibration->source_gain = CALIBRATION_GAIN_ONE;
    calibration->source_offset = 0;
    calibration->checksum = calibration_checksum(calibration);
}

static bool is_gain(uint16_t gain) { return gain >= CALIBRATION_GAIN_LOWEST && gain <= CALIBRATION_GAIN_HIGHEST; }

static bool is_offset(int16_t offset) {
    return offset >= -CALIBRATION_OFFSET_HIGHEST && offset <= CALIBRATION_OFFSET_HIGHEST;
}

bool calibration_holds(const struct calibration *calibration) {
    return calibration->checksum == calibration_checksum(calibration) && is_gain(calibration->current_gain) &&
           is_gain(calibration->voltage_gain) && is_gain(calibration->source_gain) &&
           is_offset(calibration->current_offset) && is_offset(calibration->voltage_offset) &&
           is_offset(calibration->source_offset);
}

uint16_t calibration_apply(uint16_t count, uint16_t gain, int16_t offset) {
    const int32_t number = (int32_t)(((uint32_t)count * gain) >> GAIN_BITS) + offset;
    if (number <= 0) {
        return 0;
    }
    return number > UINT16_MAX ? UINT16_MAX : (uint16_t)number;
}
