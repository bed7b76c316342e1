/* Frames of Modbus RTU. docs/sma-reference.md, "Frames". */
#ifndef FRAME_H
#define FRAME_H

#include <stdbool.h>
#include <stdint.h>

#include "board.h"

#define FRAME_CRC_START 0xFFFFu

/* CRC-16 of Modbus: `crc` continued by `byte`. */
uint16_t frame_crc(uint16_t crc, uint8_t byte);

/* The next byte begins a frame. */
void frame_begin(struct board_frame *frame);

/* Takes a byte. Returns true when it completes a request of a known function with the right CRC. */
bool frame_add(struct board_frame *frame, uint8_t byte);

/* The line is silent. Returns true when the bytes before are a request of an unknown function with the right CRC. */
bool frame_ends(const struct board_frame *frame);

/* Appends the CRC to a reply of `length` bytes, and returns its new length. */
uint8_t frame_seal(struct board_frame *frame, uint8_t length);

#endif
