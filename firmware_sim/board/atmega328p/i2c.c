/* The TWI unit as master. ATmega328P data sheet (Microchip DS40002061), chapter "2-wire Serial Interface", table
 * "Status Codes for Master". SCL = 16 MHz / (16 + 2 TWBR) = 400 kHz.
 *
 * Every wait has a limit of about 70 us; a byte needs 23 us. After an error the unit is switched off, which releases
 * the bus. A chip that was interrupted while it sent keeps SDA low; nine clock pulses free it (I2C specification,
 * NXP UM10204, 3.1.16 "Bus clear").
 */
#include "i2c.h"

#include <avr/io.h>
#include <util/delay_basic.h>

#include "pins.h"

#define BIT_RATE 12u
#define WAIT_TURNS 100u
#define PULSES 9u
#define HALF_PULSE_TURNS 27u /* of 3 cycles: 5 us */

enum {
    STARTED = 0x08,
    RESTARTED = 0x10,
    ADDRESS_ACK = 0x18,
    DATA_ACK = 0x28,
    READ_ACK = 0x40,
    GOT = 0x50,
    GOT_LAST = 0x58
};

static bool operate(uint8_t bits, uint8_t status) {
    TWCR = _BV(TWINT) | _BV(TWEN) | bits;
    for (uint8_t turns = WAIT_TURNS; turns; turns--) {
        if (TWCR & _BV(TWINT)) {
            return (TWSR & 0xF8) == status;
        }
    }
    return false;
}

static bool send(uint8_t byte, uint8_t status) {
    TWDR = byte;
    return operate(0, status);
}

static bool stop(bool good) {
    TWCR = _BV(TWINT) | _BV(TWEN) | _BV(TWSTO);
    for (uint8_t turns = WAIT_TURNS; turns; turns--) {
        if (!(TWCR & _BV(TWSTO))) {
            break;
        }
    }
    if (!good) {
        TWCR = 0;
    }
    return good;
}

/* The pins have pull-up resistors, so a pin is low while it is an output, and free while it is an input. */
static void free_bus(void) {
    for (uint8_t pulse = 0; pulse < PULSES && !(PINC & I2C_DATA); pulse++) {
        DDRC |= I2C_CLOCK;
        _delay_loop_1(HALF_PULSE_TURNS);
        DDRC &= (uint8_t)~I2C_CLOCK;
        _delay_loop_1(HALF_PULSE_TURNS);
    }
}

static bool start(uint8_t address_and_direction, uint8_t status) {
    if (!(TWCR & _BV(TWEN))) {
        free_bus();
        TWBR = BIT_RATE;
        TWSR = 0;
    }
    return operate(_BV(TWSTA), STARTED) && send(address_and_direction, status);
}

static bool receive(uint8_t *bytes, uint8_t count) {
    bool good = true;
    while (good && count--) {
        good = count ? operate(_BV(TWEA), GOT) : operate(0, GOT_LAST);
        *bytes++ = TWDR;
    }
    return good;
}

bool i2c_write(uint8_t address, const uint8_t *bytes, uint8_t count) {
    bool good = start((uint8_t)(address << 1), ADDRESS_ACK);
    while (good && count--) {
        good = send(*bytes++, DATA_ACK);
    }
    return stop(good);
}

bool i2c_read(uint8_t address, uint8_t *bytes, uint8_t count) {
    return stop(start((uint8_t)(address << 1 | 1), READ_ACK) && receive(bytes, count));
}

bool i2c_read_register(uint8_t address, uint8_t pointer, uint16_t *value) {
    uint8_t bytes[2];
    bool good = start((uint8_t)(address << 1), ADDRESS_ACK) && send(pointer, DATA_ACK) &&
                operate(_BV(TWSTA), RESTARTED) && send((uint8_t)(address << 1 | 1), READ_ACK) &&
                receive(bytes, sizeof bytes);
    if (good) {
        *value = (uint16_t)(bytes[0] << 8 | bytes[1]);
    }
    return stop(good);
}
