/* The UART of the ATmega328P: data sheet, chapter "USART0".
 *
 * The receiver keeps two bytes and a third in its shift register. When the start bit of a fourth arrives, that byte is
 * lost and DOR0 is set. The transmitter has a data register and a shift register. The host sends at exactly
 * 115200 bits/s; the board sends at the rate of UBRR0 and U2X0. A frame has 10 bits (8N1).
 */
#include <string.h>

#include "parts.h"

#define FRAME_BITS 10
#define HOST_CYCLES ((double)EMULATOR_HZ * FRAME_BITS / 115200)

enum { RXC0 = 0x80, TXC0 = 0x40, UDRE0 = 0x20, DOR0 = 0x08, U2X0 = 0x02 }; /* UCSR0A */
enum { RXCIE0 = 0x80, UDRIE0 = 0x20, RXEN0 = 0x10, TXEN0 = 0x08 };         /* UCSR0B */

static void show_flags(struct emulator *emulator) {
    struct uart *uart = &emulator->uart;
    uint8_t flags = emulator->avr->data[UCSR0A] & U2X0;
    flags |= uart->buffered ? RXC0 : 0;
    flags |= uart->complete ? TXC0 : 0;
    flags |= uart->waiting ? 0 : UDRE0;
    flags |= uart->overrun ? DOR0 : 0;
    emulator->avr->data[UCSR0A] = flags;
}

/* The interrupts of the two data registers are requested as long as their flags are set. */
static void request_interrupts(struct emulator *emulator) {
    struct uart *uart = &emulator->uart;
    show_flags(emulator);
    if (uart->buffered && emulator->avr->data[UCSR0B] & RXCIE0) {
        avr_raise_interrupt(emulator->avr, uart->received);
    }
    if (!uart->waiting && emulator->avr->data[UCSR0B] & UDRIE0) {
        avr_raise_interrupt(emulator->avr, uart->empty);
    }
}

static avr_cycle_count_t end_of_byte(avr_t *avr, avr_cycle_count_t when, void *param) {
    struct emulator *emulator = param;
    struct uart *uart = &emulator->uart;
    uint8_t byte = uart->queue[uart->first];
    (void)when;
    uart->first = (uart->first + 1) % UART_QUEUE;
    uart->queued--;
    emulator->probes.received_at = avr->cycle;
    if (avr->data[UCSR0B] & RXEN0 && !emulator->world.unpowered) {
        if (uart->lost) {
            uart->overrun = 1;
            emulator->probes.overruns++;
        } else {
            uart->buffer[uart->buffered++] = byte;
        }
    }
    uart->receiving = uart->queued > 0;
    if (uart->receiving) {
        uart->lost = uart->buffered == sizeof uart->buffer;
        uart->due += HOST_CYCLES;
        avr_cycle_timer_register(avr, (avr_cycle_count_t)(uart->due - (double)avr->cycle), end_of_byte, emulator);
    }
    request_interrupts(emulator);
    return 0;
}

static void start_byte(struct emulator *emulator) {
    struct uart *uart = &emulator->uart;
    uart->receiving = true;
    uart->lost = uart->buffered == sizeof uart->buffer;
    uart->due = (double)emulator->avr->cycle + HOST_CYCLES;
    avr_cycle_timer_register(emulator->avr, (avr_cycle_count_t)HOST_CYCLES, end_of_byte, emulator);
}

size_t emulator_send(struct emulator *emulator, const uint8_t *bytes, size_t count) {
    struct uart *uart = &emulator->uart;
    size_t taken = 0;
    while (taken < count && uart->queued < UART_QUEUE) {
        uart->queue[(uart->first + uart->queued) % UART_QUEUE] = bytes[taken++];
        uart->queued++;
    }
    if (uart->queued && !uart->receiving) {
        start_byte(emulator);
    }
    return taken;
}

size_t emulator_unsent(const struct emulator *emulator) { return emulator->uart.queued; }

size_t emulator_receive(struct emulator *emulator, struct emulator_byte *bytes, size_t count) {
    struct uart *uart = &emulator->uart;
    size_t taken = count < uart->output_count ? count : uart->output_count;
    memcpy(bytes, uart->output, taken * sizeof *bytes);
    uart->output_count -= taken;
    memmove(uart->output, uart->output + taken, uart->output_count * sizeof *bytes);
    return taken;
}

static avr_cycle_count_t sending_cycles(const avr_t *avr) {
    unsigned rate = avr->data[UBRR0L] | (avr->data[UBRR0H] & 0x0Fu) << 8;
    return FRAME_BITS * (rate + 1) * (avr->data[UCSR0A] & U2X0 ? 8 : 16);
}

static avr_cycle_count_t end_of_sending(avr_t *avr, avr_cycle_count_t when, void *param) {
    struct emulator *emulator = param;
    struct uart *uart = &emulator->uart;
    if (uart->output_count < UART_OUTPUT) {
        uart->output[uart->output_count++] = (struct emulator_byte){.cycle = when, .value = uart->shifted};
    }
    uart->shifting = uart->waiting;
    uart->shifted = uart->next;
    uart->waiting = false;
    uart->complete = !uart->shifting;
    request_interrupts(emulator);
    return uart->shifting ? when + sending_cycles(avr) : 0;
}

static void write_data(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct emulator *emulator = param;
    struct uart *uart = &emulator->uart;
    (void)address;
    if (!(avr->data[UCSR0B] & TXEN0) || uart->waiting) {
        return;
    }
    if (uart->shifting) {
        uart->next = value;
        uart->waiting = true;
    } else {
        uart->shifted = value;
        uart->shifting = true;
        avr_cycle_timer_register(avr, sending_cycles(avr), end_of_sending, emulator);
    }
    request_interrupts(emulator);
}

static uint8_t read_data(avr_t *avr, avr_io_addr_t address, void *param) {
    struct emulator *emulator = param;
    struct uart *uart = &emulator->uart;
    if (uart->buffered) {
        avr->data[address] = uart->buffer[0];
        memmove(uart->buffer, uart->buffer + 1, --uart->buffered);
        uart->overrun = 0;
    }
    request_interrupts(emulator);
    return avr->data[address];
}

static void write_status(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct emulator *emulator = param;
    avr->data[address] = value & U2X0;
    if (value & TXC0) {
        emulator->uart.complete = false;
    }
    show_flags(emulator);
}

static void write_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct emulator *emulator = param;
    avr->data[address] = value;
    if (!(value & RXEN0)) {
        emulator->uart.buffered = 0;
    }
    request_interrupts(emulator);
}

static void write_plain(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    (void)param;
    avr->data[address] = value;
}

void uart_attach(struct emulator *emulator) {
    struct uart *uart = &emulator->uart;
    uart->received = find_vector(emulator->avr, USART_RX);
    uart->empty = find_vector(emulator->avr, USART_UDRE);
    hook_write(emulator, UDR0, write_data);
    hook_read(emulator, UDR0, read_data);
    hook_write(emulator, UCSR0A, write_status);
    hook_read(emulator, UCSR0A, NULL);
    hook_write(emulator, UCSR0B, write_control);
    hook_write(emulator, UBRR0L, write_plain);
}

void uart_reset(struct emulator *emulator) {
    struct uart *uart = &emulator->uart;
    uart->buffered = uart->overrun = 0;
    uart->shifting = uart->waiting = uart->complete = false;
    uart->receiving = false;
    if (uart->queued) {
        start_byte(emulator);
    }
    show_flags(emulator);
}
