/* The faults of sensors and current. docs/sma-reference.md, "Faults". */
#ifndef SENSOR_CHECKS_H
#define SENSOR_CHECKS_H

#include "board.h"

/* The faults that the last readings show without a debounce. */
uint16_t sensor_causes(const struct board_state *state);

/* The faults of the heater current, after their debounce. `elapsed_ms` is the time since the previous check. */
uint16_t current_causes(struct board_state *state, uint32_t elapsed_ms);

#endif
