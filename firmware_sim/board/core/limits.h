/* The limits of the current. docs/sma-reference.md, "Limits". */
#ifndef LIMITS_H
#define LIMITS_H

#include "board.h"

/* Sets `set` and `limits` from the commanded current. Call it after each write and in each tick. */
void limits_apply(struct board_state *state, const struct board_hardware *hardware);

#endif
