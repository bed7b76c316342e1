/* Frames of Modbus RTU. docs/sma-reference.md, "Frames". */
#ifndef FRAME_H
#define FRAME_H

#include <stdint.h>

#define FRAME_CRC_START 0xFFFFu

/* CRC-16 of Modbus: `crc` continued by `byte`. */
uint16_t frame_crc(uint16_t crc, uint8_t byte);

#endif
