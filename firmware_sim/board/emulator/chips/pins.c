/* The pins of the board. The table is that of docs/board.md, "Pins".
 *
 *   PB2 chip select of the converter    PD2 its DRDY, low when a conversion has ended
 *   PD3 emergency stop, low while the contact is closed    PD4 enable line of the sink, pulled to low
 *   PD5 jumper of the displacement input, low when it is fitted    PC4 SDA, PC5 SCL
 */
#include "parts.h"

enum { SELECT_PIN = 1 << 2, READY_PIN = 1 << 2, ESTOP_PIN = 1 << 3, ENABLE_PIN = 1 << 4, JUMPER_PIN = 1 << 5 };
enum { SDA_PIN = 1 << 4, SCL_PIN = 1 << 5 };

void pins_update(struct emulator *emulator) {
    const uint8_t *data = emulator->avr->data;
    bool enabled = data[DDRD] & data[PORTD] & ENABLE_PIN;
    if (enabled != emulator->enabled) {
        if (enabled) {
            emulator->probes.enabled_at = emulator->avr->cycle;
        } else {
            emulator->probes.disabled_at = emulator->avr->cycle;
        }
    }
    emulator->enabled = enabled;
    spi_select(emulator, data[DDRB] & ~data[PORTB] & SELECT_PIN);
}

static void write_pin(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    avr->data[address] = value;
    pins_update(param);
}

static uint8_t read_port_d(avr_t *avr, avr_io_addr_t address, void *param) {
    struct emulator *emulator = param;
    uint8_t outside = 0xFF;
    if (converter_is_ready(emulator)) {
        outside &= (uint8_t)~READY_PIN;
    }
    if (!emulator->world.estop_open) {
        outside &= (uint8_t)~ESTOP_PIN;
    }
    if (emulator->world.displacement_fitted) {
        outside &= (uint8_t)~JUMPER_PIN;
    }
    avr->data[address] = (avr->data[DDRD] & avr->data[PORTD]) | (outside & ~avr->data[DDRD]);
    return avr->data[address];
}

static uint8_t read_port_c(avr_t *avr, avr_io_addr_t address, void *param) {
    struct emulator *emulator = param;
    uint8_t outside = 0xFF;
    if (twi_data_is_low(emulator)) {
        outside &= (uint8_t)~SDA_PIN;
    }
    if (emulator->world.stuck == STUCK_SCL) {
        outside &= (uint8_t)~SCL_PIN;
    }
    avr->data[address] = outside & ~avr->data[DDRC];
    return avr->data[address];
}

void pins_attach(struct emulator *emulator) {
    hook_write(emulator, DDRB, write_pin);
    hook_write(emulator, PORTB, write_pin);
    hook_write(emulator, DDRD, write_pin);
    hook_write(emulator, PORTD, write_pin);
    hook_read(emulator, PIND, read_port_d);
    hook_read(emulator, PINC, read_port_c);
}
