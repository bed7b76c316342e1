/* The state machine. docs/sma-reference.md, "State machine". Call all of it between board_lock and board_unlock, or in
 * the safety interrupt. */
#ifndef STATE_H
#define STATE_H

#include <stdint.h>

#include "board.h"

/* Sets current and enable to zero, then the state `mode`. */
void state_leave_armed(struct board_state *state, uint8_t mode);

/* Latches `causes`: any of them leads to the state fault. */
void state_trip(struct board_state *state, uint16_t causes);

/* Returns the exception of writing `word` to a register that accepts it: EXCEPTION_VALUE above a limit of the board,
 * EXCEPTION_STATE if the state does not allow it, or EXCEPTION_NONE. */
uint8_t state_check(const struct board *board, uint16_t address, uint16_t word);

/* Carries out a write that state_check allowed. limits_apply must follow. */
void state_write(struct board *board, uint16_t address, uint16_t word, uint32_t now_ms);

#endif
