/* The core as a shared library: what Python calls, and the locks of a target with a single thread.
 *
 * The caller owns the memory of a board, native_size() bytes. A lock that is not released, or taken twice, ends the
 * program: on a target it would stop the safety interrupt.
 */
#include <stddef.h>
#include <stdlib.h>

#include "board.h"
#include "native.h"
#include "registers.h"
#include "target.h"

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

size_t native_receive(struct board *board, const uint8_t *bytes, size_t count, uint32_t now_ms, uint8_t *replies) {
    size_t length = 0;
    for (size_t at = 0; at < count; ++at) {
        const uint8_t sent = board_receive(board, bytes[at], now_ms);
        for (uint8_t index = 0; index < sent; ++index) {
            replies[length++] = board->frame.bytes[index];
        }
    }
    return length;
}

size_t native_pause(struct board *board, uint32_t now_ms, uint8_t *replies) {
    const uint8_t sent = board_pause(board, now_ms);
    for (uint8_t index = 0; index < sent; ++index) {
        replies[index] = board->frame.bytes[index];
    }
    return sent;
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
