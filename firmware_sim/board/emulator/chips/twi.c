/* The TWI unit of the ATmega328P as master: data sheet, chapter "2-wire Serial Interface", and the I2C bus.
 *
 * A bit lasts 16 + 2 TWBR 4^TWPS cycles; a start condition needs one bit, a byte with its acknowledge nine. While SCL
 * is stuck low nothing completes. While SDA is stuck low no start condition is possible, and a byte loses the
 * arbitration (status 0x38). The firmware polls TWINT; there is no interrupt.
 *
 * A slave that was interrupted by a reset while it sent keeps SDA low until it has got nine clock pulses.
 */
#include "parts.h"

enum { TWINT = 0x80, TWEA = 0x40, TWSTA = 0x20, TWSTO = 0x10, TWEN = 0x04 }; /* TWCR */
enum { SCL_PIN = 1 << 5 };                                                   /* PC5 */

#define PULSES 9
#define RETRY_CYCLES 160

static avr_cycle_count_t bit_cycles(const avr_t *avr) {
    return 16u + 2u * avr->data[TWBR] * (1u << 2 * (avr->data[TWSR] & 3));
}

bool twi_data_is_low(const struct emulator *emulator) {
    return emulator->world.stuck == STUCK_SDA || emulator->twi.held;
}

static void finish(struct emulator *emulator, uint8_t status) {
    avr_t *avr = emulator->avr;
    emulator->twi.operation = TWI_NOTHING;
    emulator->twi.status = status;
    avr->data[TWSR] = (avr->data[TWSR] & 3) | status;
    avr->data[TWCR] |= TWINT;
}

static struct twi_slave *find_slave(struct twi *twi, uint8_t address) {
    for (int index = 0; index < TWI_SLAVES; index++) {
        if (twi->slaves[index]->address == address && !twi->slaves[index]->absent) {
            return twi->slaves[index];
        }
    }
    return NULL;
}

static uint8_t send_address(struct emulator *emulator) {
    struct twi *twi = &emulator->twi;
    uint8_t byte = emulator->avr->data[TWDR];
    twi->addressing = false;
    twi->reading = byte & 1;
    twi->selected = find_slave(twi, byte >> 1);
    if (twi->selected) {
        twi->selected->start(twi->selected, twi->reading);
    }
    if (twi->reading) {
        return twi->selected ? 0x40 : 0x48;
    }
    return twi->selected ? 0x18 : 0x20;
}

static uint8_t move_byte(struct emulator *emulator) {
    struct twi *twi = &emulator->twi;
    avr_t *avr = emulator->avr;
    if (twi_data_is_low(emulator)) {
        return 0x38;
    }
    if (twi->addressing) {
        return send_address(emulator);
    }
    if (twi->reading) {
        avr->data[TWDR] = twi->selected ? twi->selected->read(twi->selected) : 0xFF;
        return avr->data[TWCR] & TWEA ? 0x50 : 0x58;
    }
    return twi->selected && twi->selected->write(twi->selected, avr->data[TWDR]) ? 0x28 : 0x30;
}

static avr_cycle_count_t end_of_operation(avr_t *avr, avr_cycle_count_t when, void *param) {
    struct emulator *emulator = param;
    struct twi *twi = &emulator->twi;
    bool blocked = emulator->world.stuck == STUCK_SCL;
    blocked |= twi_data_is_low(emulator) && twi->operation != TWI_BYTE;
    if (blocked) {
        return when + RETRY_CYCLES;
    }
    if (twi->operation == TWI_START) {
        uint8_t status = twi->started ? 0x10 : 0x08;
        twi->started = twi->addressing = true;
        finish(emulator, status);
    } else if (twi->operation == TWI_BYTE) {
        finish(emulator, move_byte(emulator));
    } else {
        twi->started = false;
        twi->operation = TWI_NOTHING;
        avr->data[TWCR] &= (uint8_t)~TWSTO;
    }
    return 0;
}

static void abandon(struct emulator *emulator) {
    struct twi *twi = &emulator->twi;
    if (twi->started && twi->reading && twi->selected && twi->operation == TWI_BYTE) {
        twi->held = PULSES;
    }
    twi->operation = TWI_NOTHING;
    twi->selected = NULL;
    twi->started = twi->addressing = twi->reading = false;
    twi->status = 0xF8;
    emulator->avr->data[TWSR] = 0xF8;
    avr_cycle_timer_cancel(emulator->avr, end_of_operation, emulator);
}

static void write_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct emulator *emulator = param;
    struct twi *twi = &emulator->twi;
    uint8_t flag = avr->data[address] & TWINT;
    avr->data[address] = (value & (TWEA | TWSTA | TWSTO | TWEN)) | (value & TWINT ? 0 : flag);
    if (!(value & TWEN)) {
        abandon(emulator);
        return;
    }
    if (!(value & TWINT)) {
        return;
    }
    if (value & TWSTO) {
        twi->operation = TWI_STOP;
    } else if (value & TWSTA) {
        twi->operation = TWI_START;
    } else if (twi->started) {
        twi->operation = TWI_BYTE;
    } else {
        return;
    }
    avr_cycle_timer_register(avr, bit_cycles(avr) * (twi->operation == TWI_BYTE ? 9 : 1), end_of_operation, emulator);
}

static void write_status(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct emulator *emulator = param;
    avr->data[address] = (value & 3) | emulator->twi.status;
}

static void write_plain(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    (void)param;
    avr->data[address] = value;
}

/* The firmware clocks the bus by hand: SCL is low while its pin is an output. */
static void write_direction(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct emulator *emulator = param;
    bool falls = value & ~avr->data[address] & SCL_PIN;
    avr->data[address] = value;
    if (falls && emulator->twi.held && !(avr->data[TWCR] & TWEN)) {
        emulator->twi.held--;
    }
}

void twi_attach(struct emulator *emulator) {
    hook_write(emulator, TWCR, write_control);
    hook_write(emulator, TWSR, write_status);
    hook_write(emulator, TWDR, write_plain);
    hook_read(emulator, TWDR, NULL);
    hook_write(emulator, DDRC, write_direction);
}

void twi_reset(struct emulator *emulator) { abandon(emulator); }
