/* What Python calls beside the functions of board.h. */
#ifndef NATIVE_H
#define NATIVE_H

#include <stddef.h>
#include <stdint.h>

#include "board.h"

#define NATIVE_WORDS 71u

/* The state of a board as plain words. */
struct native_view {
    uint16_t faults;
    uint16_t mode;
    uint16_t limits;
    uint16_t sequence;
    uint16_t commanded;
    uint16_t set;
    uint16_t output; /* of the DAC, at the next check at the latest */
};

size_t native_size(void);

/* Takes `count` bytes, puts the replies into `buffer`, and returns their length. A reply may answer a frame that began
 * with bytes of an earlier call. */
size_t native_receive(struct board *board, const uint8_t *bytes, size_t count, uint32_t now_ms, uint8_t *buffer,
                      size_t capacity);

size_t native_pause(struct board *board, uint32_t now_ms, uint8_t *buffer, size_t capacity);

/* All words from address 0 on, 0 where no register is. */
void native_registers(const struct board *board, uint32_t now_ms, uint16_t *words);

void native_observe(const struct board *board, struct native_view *view);

#endif
