/* The line: which frames the board carries out, and which it answers. docs/sma-reference.md, "Line" and "Frames". */
#include "board.h"
#include "frame.h"
#include "request.h"

#define BROADCAST 0u

static uint8_t answer(struct board *board, uint32_t now_ms) {
    const uint8_t unit_id = board->frame.bytes[0];
    if (unit_id != BROADCAST && unit_id != board->hardware.unit_id) {
        return 0;
    }
    const uint8_t length = request_answer(board, now_ms);
    return unit_id == BROADCAST ? 0u : frame_seal(&board->frame, length);
}

uint8_t board_receive(struct board *board, uint8_t byte, uint32_t now_ms) {
    if (!frame_add(&board->frame, byte)) {
        return 0;
    }
    const uint8_t length = answer(board, now_ms);
    frame_begin(&board->frame);
    return length;
}

uint8_t board_pause(struct board *board, uint32_t now_ms) {
    const uint8_t length = frame_ends(&board->frame) ? answer(board, now_ms) : 0u;
    frame_begin(&board->frame);
    return length;
}
