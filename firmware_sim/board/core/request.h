/* The Modbus server. docs/sma-reference.md, "Line". */
#ifndef REQUEST_H
#define REQUEST_H

#include <stdint.h>

#include "board.h"

enum request_function {
    READ_REGISTERS = 3,
    WRITE_REGISTER = 6,
    LOOP_BACK = 8,
    WRITE_REGISTERS = 16,
    MASK_WRITE = 22,
    EXCHANGE = 23
};

/* Carries out the request in `board->frame.bytes` and puts the reply in its place, without the CRC. Returns the length
 * of the reply with its unit id. */
uint8_t request_answer(struct board *board, uint32_t now_ms);

#endif
