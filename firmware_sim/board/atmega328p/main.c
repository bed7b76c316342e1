/* Power-up, self-test and main loop. The main loop serves the line; everything that safety needs is in safety.c. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

#include "../core/board.h"
#include "chips.h"
#include "converter.h"
#include "line.h"
#include "memory.h"
#include "range.h"
#include "safety.h"
#include "storage.h"

#define FIRMWARE_VERSION 200u
#define UNIT_ID 1u

static struct board board;

static void power_up(void) {
    struct calibration stored;
    const struct board_hardware hardware = {
        .firmware_version = FIRMWARE_VERSION,
        .serial_number = storage_serial_number(),
        .watchdog_ms = WATCHDOG_MS,
        .temperature_max = TEMPERATURE_MAX,
        .supply_limit = SUPPLY_LIMIT,
        .sequence_start = memory_random(),
        .unit_id = UNIT_ID,
    };
    storage_read_calibration(&stored);
    board_power_up(&board, &hardware, &stored);
}

static bool test_hardware(void) {
    converter_begin();
    source_begin();
    return memory_is_good() && meters_test();
}

static void serve_pause(void) { line_send(board.frame.bytes, board_pause(&board, safety_now_ms())); }

static void serve_line(void) {
    int16_t byte;
    while ((byte = line_read()) >= 0) {
        if (byte & LINE_PAUSE) {
            serve_pause();
        }
        line_send(board.frame.bytes, board_receive(&board, (uint8_t)(byte & LINE_BYTE), safety_now_ms()));
    }
    if (line_take_pause()) {
        serve_pause();
    }
}

static void serve_storage(void) {
    struct calibration calibration;
    if (board_take_calibration(&board, &calibration)) {
        storage_write_calibration(&calibration);
    }
    storage_step();
}

/* Sleeps until the next interrupt, at most until the next tick. */
static void rest(void) {
    cli();
    if (!line_is_pending()) {
        sleep_enable();
        sei();
        sleep_cpu();
        sleep_disable();
    }
    sei();
}

/* The line stays silent until there are readings, so that no host sees a board without a temperature. */
static void wait_for_readings(void) {
    while (!safety_has_readings()) {
        board_poll(&board, safety_now_ms());
    }
}

int main(void) {
    power_up();
    safety_begin(&board, test_hardware());
    sei();
    wait_for_readings();
    line_begin();
    for (;;) {
        board_poll(&board, safety_now_ms());
        serve_line();
        serve_storage();
#ifdef HANG_HOOK
        while (GPIOR0) /* a test makes the main loop hang */
            ;
#endif
        rest();
    }
}
