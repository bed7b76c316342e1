/* The core as a shared library: what Python calls, and the locks of a target with a single thread.
 *
 * The caller owns the memory of a board, native_size() bytes. The program ends when a lock is not released or is taken
 * twice, because on a target it would stop the safety interrupt, and when a buffer is too small.
 */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "board.h"
#include "native.h"
#include "registers.h"
#include "target.h"

/* Where replies go: `length` of `capacity` bytes are used. */
struct native_replies {
    uint8_t *bytes;
    size_t capacity;
    size_t length;
};

static int locks;

void board_lock(void) {
    if (++locks != 1) {
        abort();
    }
}

void board_unlock(void) {
    if (--locks != 0) {
        abort();
    }
}

size_t native_size(void) { return sizeof(struct board); }

/* Copies a reply of `sent` bytes, and returns the new length of the replies. */
static size_t append(const struct board *board, uint8_t sent, struct native_replies *replies) {
    if (sent > replies->capacity - replies->length) {
        abort();
    }
    memcpy(&replies->bytes[replies->length], board->frame.bytes, sent);
    return replies->length + sent;
}

size_t native_receive(struct board *board, const uint8_t *bytes, size_t count, uint32_t now_ms, uint8_t *buffer,
                      size_t capacity) {
    struct native_replies replies = {buffer, capacity, 0};
    for (size_t at = 0; at < count; ++at) {
        replies.length = append(board, board_receive(board, bytes[at], now_ms), &replies);
    }
    return replies.length;
}

size_t native_pause(struct board *board, uint32_t now_ms, uint8_t *buffer, size_t capacity) {
    struct native_replies replies = {buffer, capacity, 0};
    return append(board, board_pause(board, now_ms), &replies);
}

void native_observe(const struct board *board, struct native_view *view) {
    const struct board_state *state = &board->state;
    view->faults = state->faults;
    view->mode = state->mode;
    view->limits = state->limits;
    view->sequence = state->sequence;
    view->commanded = state->commanded;
    view->set = state->set;
    view->output = board_source(state);
}

void native_registers(const struct board *board, uint32_t now_ms, uint16_t *words) {
    for (uint16_t address = 0; address < NATIVE_WORDS; ++address) {
        words[address] = register_exists(address) ? register_word(board, address, now_ms) : 0u;
    }
}
