/* The board of docs/sma-reference.md (map version 2), without a target: what a main loop and a safety interrupt call.
 *
 *   safety interrupt, every 10 ms     read the sensors -> board_tick -> DAC, enable line, hardware watchdog
 *   main loop                         bytes of the line -> board_receive, board_pause -> bytes of the reply
 *                                     board_poll, board_take_calibration
 *
 * board_tick is the only function for the interrupt; all others are for the main loop. What both share is in
 * board_state. The main loop touches it only between board_lock and board_unlock (target.h); the main loop never
 * interrupts the interrupt, so the interrupt needs no lock. The longest section between lock and unlock writes six
 * registers, sets the current and copies 14 registers.
 *
 * No heap, no recursion, no floating point. Time is an argument: `now_ms` is the time since power-up from one clock,
 * wraps at 2^32, and is the register `uptime`. Counts are those of the registers: current 0.1 mA, voltage 1 mV,
 * temperature 0.01 degC, limit of the temperature 0.1 degC, displacement 0.0001 mm.
 */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "calibration.h"

#define BOARD_NO_TEMPERATURE INT16_MIN  /* 0x8000: no reading */
#define BOARD_NO_READING UINT16_MAX     /* 0xFFFF: current or voltage without a reading */
#define BOARD_NO_DISPLACEMENT INT32_MIN /* 0x80000000: not fitted */
#define BOARD_MAX_STALL_MS 100u         /* longest time without board_poll */
#define BOARD_FRAME_SIZE 40u            /* bytes that a frame keeps; a reply is never longer */

enum board_mode { BOARD_IDLE = 0, BOARD_ARMED = 1, BOARD_FAULT = 2 }; /* the register `state` */

/* The bits of the register `faults`. */
enum board_fault {
    BOARD_WATCHDOG = 1u << 0,
    BOARD_OVER_TEMPERATURE = 1u << 1,
    BOARD_THERMOCOUPLE_OPEN = 1u << 2,
    BOARD_THERMOCOUPLE_SHORT = 1u << 3,
    BOARD_COLD_JUNCTION_RANGE = 1u << 4,
    BOARD_OVER_CURRENT = 1u << 5,
    BOARD_HEATER_OPEN = 1u << 6,
    BOARD_ESTOP = 1u << 7,
    BOARD_SENSOR_BUS = 1u << 8,
    BOARD_ACTUATOR = 1u << 9,
    BOARD_SELF_TEST = 1u << 10
};

/* The bits of the register `limits`. */
enum board_limit { BOARD_CURRENT_MAX = 1u << 0, BOARD_SUPPLY = 1u << 1, BOARD_TEMPERATURE = 1u << 2 };

/* What the target knows of its hardware. Constant after power-up. */
struct board_hardware {
    uint16_t firmware_version;
    uint32_t serial_number;   /* 0: none */
    uint16_t watchdog_ms;     /* default of the register `watchdog_s`, 50..10000 */
    uint16_t temperature_max; /* the board's own limit and the default, 0.1 degC, 0..3000 */
    uint16_t supply_limit;    /* the highest current of the source and the default of `current_max`, 0..50000 */
    uint16_t sequence_start;  /* a random number; the board makes it 256 or more */
    uint8_t unit_id;          /* 1..247 */
};

/* What the safety interrupt has read. A value that was not read now is repeated from the reading before.
 * `detected` holds the faults that only the target can see at present: THERMOCOUPLE_OPEN and _SHORT (bits of the
 * converter), ESTOP (contact open or input pressed), SENSOR_BUS (a sensor does not answer, after the retries),
 * ACTUATOR (the DAC does not answer, or its read-back differs), SELF_TEST (a check at power-up failed: memory, source).
 * A sensor that does not answer has no reading: BOARD_NO_TEMPERATURE, BOARD_NO_READING. The core adds SENSOR_BUS while
 * current or voltage has no reading, and SELF_TEST while the calibration is not valid. Current and voltage are not
 * calibrated yet. */
struct board_inputs {
    int16_t temperature;
    int16_t cold_junction;
    uint16_t current;
    uint16_t voltage;
    int32_t displacement;
    uint16_t sample_counter; /* +1 at each conversion of the thermocouple */
    uint16_t detected;       /* bits of enum board_fault; other bits than those above are ignored */
};

/* What the safety interrupt does next, in this order: enable line off if not `enable`; DAC; enable line on if
 * `enable`; hardware watchdog fed only if `alive`. */
struct board_outputs {
    uint16_t current; /* for the DAC, 0.1 mA, calibrated; 0 unless armed */
    bool enable;      /* the enable line of the current sink: true only while armed */
    bool alive;       /* false: the main loop has not called board_poll for BOARD_MAX_STALL_MS */
};

/* Shared by main loop and interrupt. */
struct board_state {
    struct board_inputs inputs; /* of the last tick, calibrated */
    struct calibration calibration;
    uint32_t fed_ms;      /* when the watchdog was fed */
    uint32_t checked_ms;  /* when board_tick ran */
    uint32_t polled_ms;   /* when board_poll ran */
    uint16_t watchdog_ms; /* the registers 48..50 */
    uint16_t temperature_max;
    uint16_t current_max;
    uint16_t sequence;
    uint16_t commanded; /* the register `heater_current` */
    uint16_t set;       /* after the limits */
    uint16_t faults;
    uint8_t limits;
    uint8_t mode;             /* enum board_mode */
    uint8_t current_wrong_ms; /* debounce of the current, at most 30 */
    bool calibration_valid;
};

/* The frame that arrives, and then its reply. Only the main loop uses it. */
struct board_frame {
    uint8_t bytes[BOARD_FRAME_SIZE]; /* the first bytes of the frame */
    uint16_t length;                 /* bytes so far, kept or not */
    uint16_t crc;                    /* over all of them */
    bool ignored;                    /* a bad frame: nothing counts until the pause */
};

struct board {
    struct board_hardware hardware;
    struct board_state state;
    struct board_frame frame;
    bool calibration_due; /* board_take_calibration has something to give */
};

/* Power up: idle, settings at their defaults. `stored` is the content of the target's storage, in which the checksum
 * says whether it is valid. */
void board_power_up(struct board *board, const struct board_hardware *hardware, const struct calibration *stored);

/* The safety interrupt. The time between two calls is at most 10 ms. */
void board_tick(struct board *board, const struct board_inputs *inputs, uint32_t now_ms,
                struct board_outputs *outputs);

/* The output of the current source for the present set current: the set current, calibrated; 0 unless armed. */
uint16_t board_source(const struct board_state *state);

/* The main loop is alive. Call it in every turn of the loop. */
void board_poll(struct board *board, uint32_t now_ms);

/* A byte has arrived. Returns how many bytes of `board->frame.bytes` are to be sent as the reply now, 0 for none.
 * Send or copy them before the next call. */
uint8_t board_receive(struct board *board, uint8_t byte, uint32_t now_ms);

/* The line has been silent for 1.75 ms since the last byte, and all bytes were received. Returns as board_receive.
 * More than one call in a pause does no harm. */
uint8_t board_pause(struct board *board, uint32_t now_ms);

/* Copies the calibration that a client has asked to save, with its checksum, and returns true; false when there is
 * none. The target then writes it to its storage while it goes on calling board_poll. */
bool board_take_calibration(struct board *board, struct calibration *record);

#endif
