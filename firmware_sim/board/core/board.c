/* Power-up, the safety interrupt and the liveness of the main loop. docs/sma-reference.md, "On a microcontroller",
 * "Watchdog" and "Calibration". */
#include "board.h"

#include "frame.h"
#include "limits.h"
#include "sensor_checks.h"
#include "state.h"
#include "target.h"

#define SEQUENCE_LOWEST 256u

static void load_calibration(struct board_state *state, const struct calibration *stored) {
    state->calibration = *stored;
    state->calibration_valid = calibration_holds(stored);
    if (!state->calibration_valid) {
        calibration_default(&state->calibration);
    }
}

/* Every word is set, so that no content of the memory before the reset remains. */
static void reset_state(struct board_state *state, const struct board_hardware *hardware) {
    const struct board_state zero = {0};
    *state = zero;
    state->inputs.temperature = BOARD_NO_TEMPERATURE;
    state->inputs.cold_junction = BOARD_NO_TEMPERATURE;
    state->inputs.current = BOARD_NO_READING;
    state->inputs.voltage = BOARD_NO_READING;
    state->inputs.displacement = BOARD_NO_DISPLACEMENT;
    state->mode = BOARD_IDLE;
    state->watchdog_ms = hardware->watchdog_ms;
    state->temperature_max = hardware->temperature_max;
    state->current_max = hardware->supply_limit;
    state->sequence = hardware->sequence_start;
    if (state->sequence < SEQUENCE_LOWEST) {
        state->sequence += SEQUENCE_LOWEST;
    }
}

void board_power_up(struct board *board, const struct board_hardware *hardware, const struct calibration *stored) {
    board->hardware = *hardware;
    reset_state(&board->state, hardware);
    load_calibration(&board->state, stored);
    frame_begin(&board->frame);
    board->calibration_due = false;
}

/* No calibration makes a reading of BOARD_NO_READING, or BOARD_NO_READING of a reading. */
static uint16_t measured(uint16_t reading, uint16_t gain, int16_t offset) {
    if (reading == BOARD_NO_READING) {
        return BOARD_NO_READING;
    }
    const uint16_t count = calibration_apply(reading, gain, offset);
    return count < BOARD_NO_READING ? count : (uint16_t)(BOARD_NO_READING - 1u);
}

/* The readings, calibrated. A converter that detects an open or shorted input gives no reading. */
static void take_inputs(struct board_state *state, const struct board_inputs *inputs) {
    const struct calibration *calibration = &state->calibration;
    state->inputs = *inputs;
    state->inputs.current = measured(inputs->current, calibration->current_gain, calibration->current_offset);
    state->inputs.voltage = measured(inputs->voltage, calibration->voltage_gain, calibration->voltage_offset);
    if (inputs->detected & (BOARD_THERMOCOUPLE_OPEN | BOARD_THERMOCOUPLE_SHORT)) {
        state->inputs.temperature = BOARD_NO_TEMPERATURE;
    }
}

static bool is_unfed(const struct board_state *state, uint32_t now_ms) {
    return state->mode == BOARD_ARMED && now_ms - state->fed_ms >= state->watchdog_ms;
}

uint16_t board_source(const struct board_state *state) {
    const struct calibration *calibration = &state->calibration;
    return state->set == 0 ? 0u : calibration_apply(state->set, calibration->source_gain, calibration->source_offset);
}

void board_tick(struct board *board, const struct board_inputs *inputs, uint32_t now_ms,
                struct board_outputs *outputs) {
    struct board_state *state = &board->state;
    take_inputs(state, inputs);
    uint16_t causes = sensor_causes(state) | current_causes(state, now_ms - state->checked_ms);
    state->checked_ms = now_ms;
    if (is_unfed(state, now_ms)) {
        causes |= BOARD_WATCHDOG;
    }
    outputs->alive = now_ms - state->polled_ms <= BOARD_MAX_STALL_MS;
    if (!outputs->alive) {
        causes |= BOARD_SELF_TEST;
    }
    state_trip(state, causes);
    limits_apply(state, &board->hardware);
    outputs->current = board_source(state);
    outputs->enable = state->mode == BOARD_ARMED;
}

void board_poll(struct board *board, uint32_t now_ms) {
    board_lock();
    board->state.polled_ms = now_ms;
    board_unlock();
}

bool board_take_calibration(struct board *board, struct calibration *record) {
    if (!board->calibration_due) {
        return false;
    }
    board->calibration_due = false;
    *record = board->state.calibration; /* only the main loop writes it, so no lock */
    record->checksum = calibration_checksum(record);
    return true;
}
