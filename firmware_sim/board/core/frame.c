/* Frames of Modbus RTU: where a frame ends, and its CRC. docs/sma-reference.md, "Frames".
 *
 * A frame of a known function ends by its length, another one at the pause. After a bad frame nothing counts until the
 * pause, so that no part of it can be taken for a request. The CRC runs along, so only the first bytes are kept: no
 * request that the board carries out is longer.
 */
#include "frame.h"

#include "request.h"

#define SHORTEST 4u
#define LONGEST 256u
#define UNKNOWN_LENGTH 0u
#define CRC_POLYNOMIAL 0xA001u

uint16_t frame_crc(uint16_t crc, uint8_t byte) {
    crc ^= byte;
    for (uint8_t bit = 0; bit < 8; ++bit) {
        crc = (crc & 1u) ? (uint16_t)((crc >> 1) ^ CRC_POLYNOMIAL) : (uint16_t)(crc >> 1);
    }
    return crc;
}

void frame_begin(struct board_frame *frame) {
    frame->length = 0;
    frame->crc = FRAME_CRC_START;
    frame->ignored = false;
}

/* The length of a request whose byte count is at `count_at`, or a length that is not reached yet. */
static uint16_t counted_length(const struct board_frame *frame, uint8_t count_at) {
    return frame->length > count_at ? (uint16_t)(count_at + 3u + frame->bytes[count_at]) : UINT16_MAX;
}

/* The length of the whole frame, or UNKNOWN_LENGTH. */
static uint16_t whole_length(const struct board_frame *frame) {
    switch (frame->bytes[1]) {
        case READ_REGISTERS:
        case WRITE_REGISTER:
        case LOOP_BACK:
            return 8;
        case MASK_WRITE:
            return 10;
        case WRITE_REGISTERS:
            return counted_length(frame, 6);
        case EXCHANGE:
            return counted_length(frame, 10);
        default:
            return UNKNOWN_LENGTH;
    }
}

static bool is_complete(const struct board_frame *frame) {
    return frame->length >= SHORTEST && frame->length == whole_length(frame);
}

bool frame_add(struct board_frame *frame, uint8_t byte) {
    if (frame->ignored) {
        return false;
    }
    if (frame->length < BOARD_FRAME_SIZE) {
        frame->bytes[frame->length] = byte;
    }
    ++frame->length;
    frame->crc = frame_crc(frame->crc, byte);
    frame->ignored = frame->length > LONGEST || (is_complete(frame) && frame->crc != 0);
    return is_complete(frame) && !frame->ignored;
}

bool frame_ends(const struct board_frame *frame) {
    return !frame->ignored && frame->length >= SHORTEST && whole_length(frame) == UNKNOWN_LENGTH && frame->crc == 0;
}

uint8_t frame_seal(struct board_frame *frame, uint8_t length) {
    uint16_t crc = FRAME_CRC_START;
    for (uint8_t at = 0; at < length; ++at) {
        crc = frame_crc(crc, frame->bytes[at]);
    }
    frame->bytes[length] = (uint8_t)crc;
    frame->bytes[length + 1u] = (uint8_t)(crc >> 8);
    return (uint8_t)(length + 2u);
}
