/* The registers: which exist, what they accept, what they show. docs/sma-reference.md, "Map". */
#include "registers.h"

#define WORDS_uint16 1u
#define WORDS_int16 1u
#define WORDS_uint32 2u
#define WORDS_int32 2u

#define IS_WRITABLE_r 0
#define IS_WRITABLE_w 1
#define IS_WRITABLE_rw 1

/* The number that a word stands for. Registers of two words cannot be written. */
#define NUMBER_uint16(word) ((int32_t)(word))
#define NUMBER_int16(word) ((int32_t)(int16_t)(word))
#define NUMBER_uint32(word) ((int32_t)(word))
#define NUMBER_int32(word) ((int32_t)(word))

bool register_exists(uint16_t address) {
#define ROW(name, first, type, access, lowest, highest)                                                               \
    if ((uint16_t)(address - (first)) < WORDS_##type) {                                                               \
        return true;                                                                                                  \
    }
    BOARD_REGISTERS(ROW)
#undef ROW
    return false;
}

static bool is_within(int32_t number, int32_t lowest, int32_t highest) {
    return number >= lowest && number <= highest;
}

uint8_t register_check(uint16_t address, uint16_t word) {
    bool is_accepted = false;
    switch (address) {
#define ROW(name, first, type, access, lowest, highest)                                                               \
    case (first):                                                                                                     \
        if (!IS_WRITABLE_##access) {                                                                                  \
            return EXCEPTION_ADDRESS;                                                                                 \
        }                                                                                                             \
        is_accepted = is_within(NUMBER_##type(word), (lowest), (highest));                                            \
        break;
        BOARD_REGISTERS(ROW)
#undef ROW
        default:
            return EXCEPTION_ADDRESS;
    }
    return is_accepted ? EXCEPTION_NONE : EXCEPTION_VALUE;
}

static uint16_t high_word(uint32_t number) { return (uint16_t)(number >> 16); }

static uint16_t low_word(uint32_t number) { return (uint16_t)number; }

static uint16_t identity_word(const struct board_hardware *hardware, uint16_t address) {
    switch (address) {
        case REGISTER_DEVICE_ID:
            return BOARD_DEVICE_ID;
        case REGISTER_MAP_VERSION:
            return BOARD_MAP_VERSION;
        case REGISTER_FIRMWARE_VERSION:
            return hardware->firmware_version;
        case REGISTER_SERIAL_NUMBER:
            return high_word(hardware->serial_number);
        default:
            return low_word(hardware->serial_number);
    }
}

static uint16_t measured_word(const struct board_inputs *inputs, uint16_t address, uint32_t now_ms) {
    switch (address) {
        case REGISTER_TEMPERATURE:
            return (uint16_t)inputs->temperature;
        case REGISTER_COLD_JUNCTION:
            return (uint16_t)inputs->cold_junction;
        case REGISTER_MEASURED_CURRENT:
            return inputs->current;
        case REGISTER_MEASURED_VOLTAGE:
            return inputs->voltage;
        case REGISTER_DISPLACEMENT:
            return high_word((uint32_t)inputs->displacement);
        case REGISTER_DISPLACEMENT + 1:
            return low_word((uint32_t)inputs->displacement);
        case REGISTER_SAMPLE_COUNTER:
            return inputs->sample_counter;
        case REGISTER_UPTIME:
            return high_word(now_ms);
        case REGISTER_UPTIME + 1:
            return low_word(now_ms);
        default: /* REGISTER_ESTOP */
            return (inputs->detected & BOARD_ESTOP) != 0;
    }
}

static uint16_t state_word(const struct board_state *state, uint16_t address) {
    switch (address) {
        case REGISTER_SEQUENCE_ECHO:
        case REGISTER_SEQUENCE:
            return state->sequence;
        case REGISTER_STATE:
            return state->mode;
        case REGISTER_FAULTS:
            return state->faults;
        case REGISTER_LIMITS:
            return state->limits;
        case REGISTER_HEATER_CURRENT:
            return state->commanded;
        case REGISTER_HEATER_ENABLE:
            return state->mode == BOARD_ARMED;
        case REGISTER_WATCHDOG_S:
            return state->watchdog_ms;
        case REGISTER_TEMPERATURE_MAX:
            return state->temperature_max;
        case REGISTER_CURRENT_MAX:
            return state->current_max;
        default: /* a key: write-only */
            return 0;
    }
}

static uint16_t calibration_word(const struct calibration *calibration, uint16_t address) {
    switch (address) {
        case REGISTER_CURRENT_GAIN:
            return calibration->current_gain;
        case REGISTER_CURRENT_OFFSET:
            return (uint16_t)calibration->current_offset;
        case REGISTER_VOLTAGE_GAIN:
            return calibration->voltage_gain;
        case REGISTER_VOLTAGE_OFFSET:
            return (uint16_t)calibration->voltage_offset;
        case REGISTER_SOURCE_GAIN:
            return calibration->source_gain;
        case REGISTER_SOURCE_OFFSET:
            return (uint16_t)calibration->source_offset;
        default: /* the key */
            return 0;
    }
}

uint16_t register_word(const struct board *board, uint16_t address, uint32_t now_ms) {
    if (address < REGISTER_SEQUENCE_ECHO) {
        return identity_word(&board->hardware, address);
    }
    if (address >= REGISTER_CURRENT_GAIN) {
        return calibration_word(&board->state.calibration, address);
    }
    if (address >= REGISTER_TEMPERATURE && address <= REGISTER_ESTOP) {
        return measured_word(&board->state.inputs, address, now_ms);
    }
    return state_word(&board->state, address);
}
