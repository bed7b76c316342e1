/* The Modbus server: checks a request, carries it out, makes the reply. docs/sma-reference.md, "Line".
 *
 * The order of the checks is function, quantity, addresses, values, state. Everything is checked before anything is
 * written, and check and write are one section that the safety interrupt cannot divide.
 */
#include "request.h"

#include "limits.h"
#include "registers.h"
#include "state.h"
#include "target.h"

#define EXCEPTION_BIT 0x80u

#define MAX_READ 125u
#define MAX_WRITTEN 123u
#define MAX_EXCHANGE_WRITTEN 121u

/* Registers that a request writes: their words are in the frame. */
struct written {
    uint16_t first;
    uint16_t count;
    const uint8_t *words;
};

static uint16_t word_at(const uint8_t *bytes) { return (uint16_t)((uint16_t)(bytes[0] << 8) | bytes[1]); }

static void put_word(uint8_t *bytes, uint16_t word) {
    bytes[0] = (uint8_t)(word >> 8);
    bytes[1] = (uint8_t)word;
}

static bool is_quantity(uint16_t count, uint16_t most) { return count >= 1 && count <= most; }

static bool all_exist(uint16_t first, uint16_t count) {
    for (uint16_t at = 0; at < count; ++at) {
        if (!register_exists((uint16_t)(first + at))) {
            return false;
        }
    }
    return true;
}

/* An address comes before a value. Only the first words are in the frame; no more than seven can be written, so the
 * check ends before the others. */
static uint8_t check_registers(const struct written *written) {
    uint8_t code = EXCEPTION_NONE;
    for (uint16_t at = 0; at < written->count; ++at) {
        const uint8_t found = register_check((uint16_t)(written->first + at), word_at(&written->words[2u * at]));
        if (found == EXCEPTION_ADDRESS) {
            return found;
        }
        if (found != EXCEPTION_NONE) {
            code = found;
        }
    }
    return code;
}

/* Between board_lock and board_unlock. */
static uint8_t check_and_write(struct board *board, const struct written *written, uint32_t now_ms) {
    for (uint16_t at = 0; at < written->count; ++at) {
        const uint8_t code = state_check(board, (uint16_t)(written->first + at), word_at(&written->words[2u * at]));
        if (code != EXCEPTION_NONE) {
            return code;
        }
    }
    for (uint16_t at = 0; at < written->count; ++at) {
        state_write(board, (uint16_t)(written->first + at), word_at(&written->words[2u * at]), now_ms);
    }
    limits_apply(&board->state, &board->hardware);
    return EXCEPTION_NONE;
}

static uint8_t write_words(struct board *board, const struct written *written, uint32_t now_ms) {
    const uint8_t checked = check_registers(written);
    if (checked != EXCEPTION_NONE) {
        return checked;
    }
    board_lock();
    const uint8_t code = check_and_write(board, written, now_ms);
    board_unlock();
    return code;
}

/* Puts the byte count and the words of existing registers behind the function, and returns the length of the reply.
 * No range of existing registers has more than 14 words. */
static uint8_t put_registers(struct board *board, uint16_t first, uint16_t count, uint32_t now_ms) {
    uint8_t *bytes = &board->frame.bytes[2];
    *bytes++ = (uint8_t)(2u * count);
    board_lock();
    for (uint16_t at = 0; at < count; ++at, bytes += 2) {
        put_word(bytes, register_word(board, (uint16_t)(first + at), now_ms));
    }
    board_unlock();
    return (uint8_t)(3u + 2u * count);
}

/* Each of these returns an exception code, or EXCEPTION_NONE and the length of the reply with its unit id. */

static uint8_t read_registers(struct board *board, uint32_t now_ms, uint8_t *length) {
    const uint8_t *pdu = &board->frame.bytes[1];
    const uint16_t first = word_at(&pdu[1]);
    const uint16_t count = word_at(&pdu[3]);
    if (!is_quantity(count, MAX_READ)) {
        return EXCEPTION_VALUE;
    }
    if (!all_exist(first, count)) {
        return EXCEPTION_ADDRESS;
    }
    *length = put_registers(board, first, count, now_ms);
    return EXCEPTION_NONE;
}

static uint8_t write_register(struct board *board, uint32_t now_ms, uint8_t *length) {
    const uint8_t *pdu = &board->frame.bytes[1];
    const struct written written = {word_at(&pdu[1]), 1, &pdu[3]};
    *length = 6;
    return write_words(board, &written, now_ms);
}

static uint8_t write_registers(struct board *board, uint32_t now_ms, uint8_t *length) {
    const uint8_t *pdu = &board->frame.bytes[1];
    const struct written written = {word_at(&pdu[1]), word_at(&pdu[3]), &pdu[6]};
    if (!is_quantity(written.count, MAX_WRITTEN) || pdu[5] != 2u * written.count) {
        return EXCEPTION_VALUE;
    }
    *length = 6;
    return write_words(board, &written, now_ms);
}

static uint8_t mask_write(struct board *board, uint32_t now_ms, uint8_t *length) {
    const uint8_t *pdu = &board->frame.bytes[1];
    const uint16_t address = word_at(&pdu[1]);
    if (!register_exists(address)) {
        return EXCEPTION_ADDRESS;
    }
    board_lock();
    const uint16_t word = register_word(board, address, now_ms);
    board_unlock();
    const uint16_t and_mask = word_at(&pdu[3]);
    uint8_t masked[2];
    put_word(masked, (uint16_t)((word & and_mask) | (word_at(&pdu[5]) & ~and_mask)));
    const struct written written = {address, 1, masked};
    *length = 8;
    return write_words(board, &written, now_ms);
}

static uint8_t exchange(struct board *board, uint32_t now_ms, uint8_t *length) {
    const uint8_t *pdu = &board->frame.bytes[1];
    const uint16_t first = word_at(&pdu[1]);
    const uint16_t count = word_at(&pdu[3]);
    const struct written written = {word_at(&pdu[5]), word_at(&pdu[7]), &pdu[10]};
    if (!is_quantity(count, MAX_READ) || !is_quantity(written.count, MAX_EXCHANGE_WRITTEN) ||
        pdu[9] != 2u * written.count) {
        return EXCEPTION_VALUE;
    }
    if (!all_exist(first, count)) {
        return EXCEPTION_ADDRESS;
    }
    const uint8_t code = write_words(board, &written, now_ms);
    if (code == EXCEPTION_NONE) {
        *length = put_registers(board, first, count, now_ms);
    }
    return code;
}

static uint8_t loop_back(const struct board *board, uint8_t *length) {
    *length = 6;
    if (word_at(&board->frame.bytes[2]) != 0) {
        return EXCEPTION_FUNCTION;
    }
    return EXCEPTION_NONE;
}

static uint8_t carry_out(struct board *board, uint32_t now_ms, uint8_t *length) {
    switch (board->frame.bytes[1]) {
        case READ_REGISTERS:
            return read_registers(board, now_ms, length);
        case WRITE_REGISTER:
            return write_register(board, now_ms, length);
        case LOOP_BACK:
            return loop_back(board, length);
        case WRITE_REGISTERS:
            return write_registers(board, now_ms, length);
        case MASK_WRITE:
            return mask_write(board, now_ms, length);
        case EXCHANGE:
            return exchange(board, now_ms, length);
        default:
            return EXCEPTION_FUNCTION;
    }
}

uint8_t request_answer(struct board *board, uint32_t now_ms) {
    uint8_t length = 0;
    const uint8_t code = carry_out(board, now_ms, &length);
    if (code == EXCEPTION_NONE) {
        return length;
    }
    board->frame.bytes[1] |= EXCEPTION_BIT;
    board->frame.bytes[2] = code;
    return 3;
}
