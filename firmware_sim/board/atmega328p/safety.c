/* Timer 1 counts 4 us (16 MHz / 64) and has a compare match every 2500 counts. The interrupt masks itself and then lets
 * all others interrupt it, so that no byte of the line is lost. docs/sma-reference.md, "On a microcontroller".
 *
 * A chip that does not answer keeps its last values for two ticks; then its fault is set, and its values are unknown: an
 * old current would look like a shorted switch, and a zero like the proof that no current flows. The DAC keeps its output when
 * it is not reached, so the enable line is switched off at once when the DAC fails.
 */
#include "safety.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>

#include "../core/target.h"
#include "chips.h"
#include "converter.h"
#include "pins.h"
#include "range.h"

#define TICK_MS 10u
#define TICK_COUNTS 2500u
#define COUNTS_PER_MS 250u
#define FAILED_TICKS 3u
#define STALLED_TICKS 30u /* 0.3 s without a conversion */

static struct board *board;
static struct board_inputs inputs;
static volatile uint32_t tick_ms;
static uint8_t silent_converter, silent_meters, stalled;
static uint16_t self_test_fault;
static bool source_failed;

static uint8_t counted(uint8_t count, bool failed) { return !failed ? 0 : count < UINT8_MAX ? count + 1u : count; }

static uint16_t read_converter(void) {
    struct converter_reading reading;
    enum converter_status status = converter_read(&reading);
    if (status == CONVERTER_NEW) {
        inputs.temperature = reading.temperature;
        inputs.cold_junction = reading.cold_junction;
        inputs.sample_counter++;
    }
    silent_converter = counted(silent_converter, status == CONVERTER_SILENT);
    /* A converter that keeps resetting alternates between the two, and ends no conversion. */
    stalled = counted(stalled, status == CONVERTER_SAME || status == CONVERTER_SILENT);
    if (status == CONVERTER_OPEN) {
        return BOARD_THERMOCOUPLE_OPEN;
    }
    if (status == CONVERTER_SHORT) {
        return BOARD_THERMOCOUPLE_SHORT;
    }
    if (silent_converter < FAILED_TICKS && stalled < STALLED_TICKS) {
        return 0;
    }
    inputs.temperature = inputs.cold_junction = BOARD_NO_TEMPERATURE;
    return BOARD_SENSOR_BUS;
}

static uint16_t read_meters(void) {
    silent_meters = counted(silent_meters, !meters_read(&inputs.current, &inputs.voltage));
    if (silent_meters < FAILED_TICKS) {
        return 0;
    }
    inputs.current = inputs.voltage = BOARD_NO_READING;
    return BOARD_SENSOR_BUS;
}

/* The conversion that began in the tick before. */
static void read_displacement(void) {
    inputs.displacement = PIND & JUMPER ? BOARD_NO_DISPLACEMENT : ADC * DISPLACEMENT_STEP;
    ADCSRA |= _BV(ADSC);
}

static void switch_off(void) { PORTD &= (uint8_t)~ENABLE; }

static void read_inputs(void) {
    read_displacement();
    inputs.detected = self_test_fault | read_converter() | read_meters();
    source_failed |= !source_test();
    if (source_failed) {
        inputs.detected |= BOARD_ACTUATOR;
    }
    if (PIND & ESTOP_OPEN) {
        inputs.detected |= BOARD_ESTOP;
    }
}

static void write_outputs(const struct board_outputs *outputs) {
    bool on = outputs->enable && outputs->alive;
    if (!on) {
        switch_off();
    }
    source_failed = !source_set(on ? outputs->current : 0);
    if (source_failed) {
        switch_off();
    } else if (on) {
        PORTD |= ENABLE;
    }
    if (outputs->alive) {
        wdt_reset();
    }
}

ISR(TIMER1_COMPA_vect) {
    struct board_outputs outputs;
    TIMSK1 = 0;
    tick_ms += TICK_MS;
    sei();
    if (PIND & ESTOP_OPEN) {
        switch_off();
    }
    read_inputs();
    board_tick(board, &inputs, tick_ms, &outputs);
    write_outputs(&outputs);
    cli();
    TIMSK1 = _BV(OCIE1A);
}

void board_lock(void) { TIMSK1 = 0; }

void board_unlock(void) { TIMSK1 = _BV(OCIE1A); }

bool safety_has_readings(void) {
    board_lock();
    bool has_readings = inputs.temperature != BOARD_NO_TEMPERATURE || inputs.detected;
    board_unlock();
    return has_readings;
}

uint32_t safety_now_ms(void) {
    cli();
    uint32_t ms = tick_ms;
    uint16_t counts = TCNT1;
    bool matched = TIFR1 & _BV(OCF1A) && counts < TICK_COUNTS / 2;
    sei();
    return ms + (matched ? TICK_MS : 0) + counts / COUNTS_PER_MS;
}

void safety_begin(struct board *own_board, bool passed) {
    board = own_board;
    self_test_fault = passed ? 0 : BOARD_SELF_TEST;
    inputs.temperature = inputs.cold_junction = BOARD_NO_TEMPERATURE;
    inputs.current = inputs.voltage = BOARD_NO_READING;
    PORTD |= ESTOP_OPEN | JUMPER | CONVERTER_READY;
    DDRD |= ENABLE;
    ADMUX = _BV(REFS1) | _BV(REFS0);
    ADCSRA = _BV(ADEN) | _BV(ADSC) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0);
    OCR1A = TICK_COUNTS - 1;
    TCCR1B = _BV(WGM12) | _BV(CS11) | _BV(CS10);
    TIMSK1 = _BV(OCIE1A);
    wdt_enable(WDTO_120MS);
}
