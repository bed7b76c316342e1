/* The faults of sensors and current. docs/sma-reference.md, "Faults". */
#include "sensor_checks.h"

#define CENTI_C_PER_COUNT 10
#define COLD_JUNCTION_LOWEST (-2000) /* 0.01 degC */
#define COLD_JUNCTION_HIGHEST 8500
#define DEBOUNCE_MS 30u
#define CURRENT_MARGIN 500u /* 50 mA */

#define DETECTED_BY_TARGET                                                                                            \
    (BOARD_THERMOCOUPLE_OPEN | BOARD_THERMOCOUPLE_SHORT | BOARD_ESTOP | BOARD_SENSOR_BUS | BOARD_ACTUATOR |           \
     BOARD_SELF_TEST)

uint16_t sensor_causes(const struct board_state *state) {
    const struct board_inputs *inputs = &state->inputs;
    uint16_t causes = inputs->detected & DETECTED_BY_TARGET;
    if (inputs->current == BOARD_NO_READING || inputs->voltage == BOARD_NO_READING) {
        causes |= BOARD_SENSOR_BUS;
    }
    if (!state->calibration_valid) {
        causes |= BOARD_SELF_TEST;
    }
    if (inputs->temperature >= (int32_t)state->temperature_max * CENTI_C_PER_COUNT) {
        causes |= BOARD_OVER_TEMPERATURE;
    }
    if (inputs->cold_junction != BOARD_NO_TEMPERATURE &&
        (inputs->cold_junction < COLD_JUNCTION_LOWEST || inputs->cold_junction > COLD_JUNCTION_HIGHEST)) {
        causes |= BOARD_COLD_JUNCTION_RANGE;
    }
    return causes;
}

static bool is_known(const struct board_state *state) { return state->inputs.current != BOARD_NO_READING; }

/* More than 110 % of the set current + 50 mA. */
static bool is_excess(const struct board_state *state) {
    return is_known(state) && 10ul * state->inputs.current > 11ul * state->set + 10ul * CURRENT_MARGIN;
}

/* Less than half the set current, while this is above 50 mA. */
static bool is_lack(const struct board_state *state) {
    return is_known(state) && state->set > CURRENT_MARGIN && 2ul * state->inputs.current < state->set;
}

uint16_t current_causes(struct board_state *state, uint32_t elapsed_ms) {
    const bool excess = is_excess(state);
    if (!excess && !is_lack(state)) {
        state->current_wrong_ms = 0;
        return 0;
    }
    const uint32_t wrong_ms = state->current_wrong_ms + elapsed_ms;
    if (wrong_ms < DEBOUNCE_MS) {
        state->current_wrong_ms = (uint8_t)wrong_ms;
        return 0;
    }
    state->current_wrong_ms = DEBOUNCE_MS;
    return excess ? BOARD_OVER_CURRENT : BOARD_HEATER_OPEN;
}
