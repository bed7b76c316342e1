/* An ATmega328P at 16 MHz with the chips of the board around it. The program that runs on it is an ELF file.
 *
 * libsimavr executes the instructions, timers, watchdog, EEPROM and ADC. Its UART, TWI and SPI units do not have the
 * times of the hardware, and its receive buffer never overruns; so these three units are written here (uart.c, twi.c,
 * spi.c), cycle by cycle after the data sheet of the ATmega328P (Microchip DS40002061). The chips on the buses are in
 * converter.c, meter.c and dac.c. Time is counted in cycles of the processor.
 */
#ifndef EMULATOR_H
#define EMULATOR_H

#include <stddef.h>
#include <stdint.h>

#define EMULATOR_HZ 16000000u

enum emulator_converter {
    CONVERTER_GOOD,
    CONVERTER_OPEN,
    CONVERTER_SHORT,
    CONVERTER_ABSENT,
    CONVERTER_STOPPED,
    CONVERTER_RESETTING /* it resets before the end of every conversion */
};
enum emulator_stuck { STUCK_NONE, STUCK_SDA, STUCK_SCL };
enum emulator_reset { RESET_LINE, RESET_BROWN_OUT, RESET_POWER };

/* What the pins and chips see of the world. The caller may change it between two calls of emulator_run. */
struct emulator_world {
    double temperature_c;   /* of the bead */
    double cold_junction_c; /* of the converter */
    double current_a;       /* through the wire */
    double wire_top_v;      /* at the end of the wire near the supply */
    double wire_bottom_v;   /* at the drain of the sink */
    double displacement_v;  /* at the analogue input */
    double full_scale_a;    /* current of the sink at the DAC code 4096 */
    double shunt_ohm;
    int32_t converter; /* enum emulator_converter */
    int32_t stuck;     /* enum emulator_stuck: the I2C bus */
    int32_t dac_absent;
    int32_t top_meter_absent;
    int32_t bottom_meter_absent;
    int32_t estop_open;          /* the contact of the emergency stop has opened */
    int32_t displacement_fitted; /* the jumper */
    int32_t unpowered;           /* held in reset without supply */
};

/* Figures, in cycles. The caller may set them to zero. */
struct emulator_probes {
    uint64_t safety_longest; /* from the first to the last instruction of the safety interrupt */
    uint64_t safety_count;
    uint64_t safety_latency_min; /* from the compare match to the first instruction */
    uint64_t safety_latency_max;
    uint64_t off_longest; /* longest time with interrupts disabled, after the first time they were enabled */
    uint64_t overruns;    /* bytes lost because the receiver was full */
    uint64_t resets_by_watchdog;
    uint64_t enabled_at;  /* when the enable line last went high */
    uint64_t disabled_at; /* when it last went low */
    uint64_t received_at; /* when the last byte from the host was complete */
};

struct emulator_byte {
    uint64_t cycle; /* when its stop bit was complete */
    uint8_t value;
};

struct emulator;

/* NULL when the file cannot be loaded. `seed` determines the content of the RAM at power-up. */
struct emulator *emulator_create(const char *elf_path, uint32_t seed);
void emulator_destroy(struct emulator *emulator);

struct emulator_world *emulator_world(struct emulator *emulator);
struct emulator_probes *emulator_probes(struct emulator *emulator);
uint8_t *emulator_ram(struct emulator *emulator); /* the data space, 2304 bytes from address 0 */
uint64_t emulator_cycle(const struct emulator *emulator);

/* Runs to the end of the instruction in which `cycle` is reached. Returns 0, or -1 when the program has crashed. */
int emulator_run(struct emulator *emulator, uint64_t cycle);

/* Executes `count` instructions. */
int emulator_step(struct emulator *emulator, uint64_t count);

/* RESET_POWER also restarts the chips on the buses, and gives the RAM a random content. */
void emulator_reset(struct emulator *emulator, int cause);

/* The host sends bytes at 115200 bits/s. Returns how many were taken. */
size_t emulator_send(struct emulator *emulator, const uint8_t *bytes, size_t count);

/* Bytes that the host has sent and that are not complete yet. */
size_t emulator_unsent(const struct emulator *emulator);

/* Moves bytes that the board has sent to `bytes`, at most `count`. Returns how many. */
size_t emulator_receive(struct emulator *emulator, struct emulator_byte *bytes, size_t count);

/* The set current of the sink: 0 while the enable line is low. */
double emulator_sink_a(const struct emulator *emulator);

/* Writes bytes of the EEPROM. */
void emulator_write_eeprom(struct emulator *emulator, uint16_t address, uint8_t *bytes, uint16_t count);

#endif
