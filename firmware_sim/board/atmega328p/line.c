/* Interrupts of USART0 and timer 2. ATmega328P data sheet (Microchip DS40002061), chapters "USART0" and "TC2".
 *
 * UBRR0 = 16 with U2X0 gives 117647 bits/s, 2.1 % above 115200, as on every Arduino with 16 MHz. Timer 2 counts 8 us
 * (16 MHz / 128); 219 counts are the pause of 1.75 ms. Each byte restarts it. The safety interrupt may keep the main loop
 * from running until the next byte has come, so a pause is kept with the byte that ends it.
 */
#include "line.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#define RECEIVE_SIZE 128u /* powers of two */
#define SEND_SIZE 64u
#define PAUSE_COUNTS 219u

static volatile uint16_t received[RECEIVE_SIZE]; /* bytes, with LINE_PAUSE */
static volatile uint8_t received_in, received_out;
static volatile uint8_t sent[SEND_SIZE];
static volatile uint8_t sent_in, sent_out;
static volatile bool paused;

ISR(USART_RX_vect) {
    uint16_t byte = UDR0 | (paused ? LINE_PAUSE : 0u);
    uint8_t next = (received_in + 1u) & (RECEIVE_SIZE - 1u);
    TCNT2 = 0;
    TIFR2 = _BV(OCF2A);
    TIMSK2 = _BV(OCIE2A);
    paused = false;
    if (next != received_out) {
        received[received_in] = byte;
        received_in = next;
    }
}

ISR(TIMER2_COMPA_vect) {
    TIMSK2 = 0;
    paused = true;
}

ISR(USART_UDRE_vect) {
    UDR0 = sent[sent_out];
    sent_out = (sent_out + 1u) & (SEND_SIZE - 1u);
    if (sent_out == sent_in) {
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
    }
}

void line_begin(void) {
    UBRR0 = 16;
    UCSR0A = _BV(U2X0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
    OCR2A = PAUSE_COUNTS;
    TCCR2B = _BV(CS22) | _BV(CS20);
}

int16_t line_read(void) {
    uint8_t out = received_out;
    if (out == received_in) {
        return -1;
    }
    int16_t byte = (int16_t)received[out];
    received_out = (out + 1u) & (RECEIVE_SIZE - 1u);
    return byte;
}

bool line_take_pause(void) {
    bool taken = false;
    cli();
    if (paused && received_in == received_out) {
        paused = false;
        taken = true;
    }
    sei();
    return taken;
}

bool line_is_pending(void) { return paused || received_in != received_out; }

void line_send(const uint8_t *bytes, uint8_t count) {
    while (count--) {
        uint8_t next = (sent_in + 1u) & (SEND_SIZE - 1u);
        if (next == sent_out) {
            break;
        }
        sent[sent_in] = *bytes++;
        sent_in = next;
    }
    cli();
    if (sent_in != sent_out) {
        UCSR0B |= _BV(UDRIE0);
    }
    sei();
}
