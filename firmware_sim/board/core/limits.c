/* The limits that hold the current back. docs/sma-reference.md, "Limits". */
#include "limits.h"

#define DERATE_CENTI_C 500 /* the last 5 degC below temperature_max */
#define CENTI_C_PER_COUNT 10

/* The highest current at this temperature: current_max, falling linearly to zero at temperature_max, rounded down. The
 * division of 32 bits takes an AVR 40 us, and is needed only in the last 5 degC. */
static uint16_t derated(const struct board_state *state) {
    const int16_t temperature = state->inputs.temperature;
    const int32_t margin = (int32_t)state->temperature_max * CENTI_C_PER_COUNT - temperature;
    if (temperature == BOARD_NO_TEMPERATURE || margin <= 0) {
        return 0;
    }
    if (margin >= DERATE_CENTI_C) {
        return UINT16_MAX;
    }
    return (uint16_t)((uint32_t)state->current_max * (uint32_t)margin / DERATE_CENTI_C);
}

static void hold(struct board_state *state, uint16_t highest, uint8_t limit) {
    if (state->set > highest) {
        state->set = highest;
        state->limits |= limit;
    }
}

void limits_apply(struct board_state *state, const struct board_hardware *hardware) {
    state->limits = 0;
    state->set = state->mode == BOARD_ARMED ? state->commanded : 0u;
    if (state->set == 0) {
        return;
    }
    hold(state, hardware->supply_limit, BOARD_SUPPLY);
    hold(state, state->current_max, BOARD_CURRENT_MAX);
    hold(state, derated(state), BOARD_TEMPERATURE);
}
