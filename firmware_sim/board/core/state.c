/* The state machine: arming, disarming, clearing, and what each write does. docs/sma-reference.md, "State machine". */
#include "state.h"

#include "registers.h"
#include "sensor_checks.h"

void state_leave_armed(struct board_state *state, uint8_t mode) {
    state->commanded = 0;
    state->set = 0;
    state->mode = mode;
}

void state_trip(struct board_state *state, uint16_t causes) {
    if ((causes & ~state->faults) != 0) {
        state_leave_armed(state, BOARD_FAULT);
        state->faults |= causes;
    }
}

static bool is_above_own_limit(const struct board_hardware *hardware, uint16_t address, uint16_t word) {
    return (address == REGISTER_TEMPERATURE_MAX && word > hardware->temperature_max) ||
           (address == REGISTER_CURRENT_MAX && word > hardware->supply_limit);
}

uint8_t state_check(const struct board *board, uint16_t address, uint16_t word) {
    if (is_above_own_limit(&board->hardware, address, word)) {
        return EXCEPTION_VALUE;
    }
    const uint8_t mode = board->state.mode;
    const bool arms_again = address == REGISTER_ARM && mode != BOARD_IDLE;
    const bool calibrates_armed = address >= REGISTER_CURRENT_GAIN && mode == BOARD_ARMED;
    return arms_again || calibrates_armed ? EXCEPTION_STATE : EXCEPTION_NONE;
}

static void arm(struct board_state *state, uint32_t now_ms) {
    state->mode = BOARD_ARMED;
    state->fed_ms = now_ms;
}

/* A fault whose cause persists is latched again at once, or after its debounce. */
static void clear(struct board_state *state) {
    state->faults = 0;
    state->current_wrong_ms = 0;
    state_leave_armed(state, BOARD_IDLE);
    state_trip(state, sensor_causes(state));
}

static void feed(struct board_state *state, uint16_t sequence, uint32_t now_ms) {
    if (sequence != state->sequence) {
        state->sequence = sequence;
        state->fed_ms = now_ms;
    }
}

static void command(struct board_state *state, uint16_t current) {
    if (state->mode == BOARD_ARMED) {
        state->commanded = current;
    }
}

/* 0 disarms. 1 has no effect: only the arm key arms. */
static void enable(struct board_state *state, uint16_t word) {
    if (word == 0 && state->mode == BOARD_ARMED) {
        state_leave_armed(state, BOARD_IDLE);
    }
}

static void save(struct board *board) {
    board->state.calibration_valid = true;
    board->calibration_due = true;
}

static void calibrate(struct calibration *calibration, uint16_t address, uint16_t word) {
    switch (address) {
        case REGISTER_CURRENT_GAIN:
            calibration->current_gain = word;
            break;
        case REGISTER_CURRENT_OFFSET:
            calibration->current_offset = (int16_t)word;
            break;
        case REGISTER_VOLTAGE_GAIN:
            calibration->voltage_gain = word;
            break;
        case REGISTER_VOLTAGE_OFFSET:
            calibration->voltage_offset = (int16_t)word;
            break;
        case REGISTER_SOURCE_GAIN:
            calibration->source_gain = word;
            break;
        default: /* REGISTER_SOURCE_OFFSET */
            calibration->source_offset = (int16_t)word;
            break;
    }
}

void state_write(struct board *board, uint16_t address, uint16_t word, uint32_t now_ms) {
    struct board_state *state = &board->state;
    switch (address) {
        case REGISTER_SEQUENCE:
            feed(state, word, now_ms);
            break;
        case REGISTER_ARM:
            arm(state, now_ms);
            break;
        case REGISTER_FAULT_CLEAR:
            clear(state);
            break;
        case REGISTER_WATCHDOG_S:
            state->watchdog_ms = word;
            break;
        case REGISTER_TEMPERATURE_MAX:
            state->temperature_max = word;
            break;
        case REGISTER_CURRENT_MAX:
            state->current_max = word;
            break;
        case REGISTER_CALIBRATION_SAVE:
            save(board);
            break;
        case REGISTER_HEATER_CURRENT:
            command(state, word);
            break;
        case REGISTER_HEATER_ENABLE:
            enable(state, word);
            break;
        default:
            calibrate(&state->calibration, address, word);
            break;
    }
}
