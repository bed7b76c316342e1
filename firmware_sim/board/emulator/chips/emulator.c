/* Loads the program, runs it, and resets the board. */
#include "emulator.h"

#include <simavr/avr_adc.h>
#include <simavr/avr_eeprom.h>
#include <simavr/sim_elf.h>
#include <stdlib.h>
#include <string.h>

#include "parts.h"

enum { PORF = 1, EXTRF = 2, BORF = 4, WDRF = 8 }; /* MCUSR */
enum { RAM_FIRST = 0x100 };
enum { TOP_METER = 0x40, BOTTOM_METER = 0x41 };

static void no_log(avr_t *avr, const int level, const char *format, va_list arguments) {
    (void)avr, (void)level, (void)format, (void)arguments;
}

/* Sleeping costs no time of the machine. */
static void no_sleep(avr_t *avr, avr_cycle_count_t cycles) { (void)avr, (void)cycles; }

/* An interrupt that was requested while it was masked runs when the mask is lifted. */
static void write_mask(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct emulator *emulator = param;
    uint64_t matched_at = emulator->matched_at;
    avr->data[address] = value;
    if (value & 2 && avr_regbit_get(avr, emulator->safety->raised)) {
        avr_raise_interrupt(avr, emulator->safety);
    }
    emulator->matched_at = matched_at;
}

static avr_cycle_count_t stop(avr_t *avr, avr_cycle_count_t when, void *param) {
    (void)avr, (void)when, (void)param;
    return 0;
}

/* Ends a sleep when the run ends. */
static void limit_run(struct emulator *emulator) {
    if (emulator->target > emulator->avr->cycle) {
        avr_cycle_timer_register(emulator->avr, emulator->target - emulator->avr->cycle, stop, emulator);
    }
}

/* simavr has cleared the registers and the timers. */
static void on_reset(avr_io_t *io) {
    struct emulator *emulator = (struct emulator *)io;
    limit_run(emulator);
    uart_reset(emulator);
    twi_reset(emulator);
    spi_reset(emulator);
    pins_update(emulator);
}

static void power_up_chips(struct emulator *emulator) {
    converter_power_up(&emulator->converter);
    meter_power_up(&emulator->top, TOP_METER, &emulator->shunt_v, &emulator->world.wire_top_v);
    meter_power_up(&emulator->bottom, BOTTOM_METER, &emulator->shunt_v, &emulator->world.wire_bottom_v);
    dac_power_up(&emulator->dac);
    emulator->twi.held = 0;
}

static void scramble_ram(struct emulator *emulator) {
    for (int address = RAM_FIRST; address <= emulator->avr->ramend; address++) {
        emulator->random = emulator->random * 1664525u + 1013904223u;
        emulator->avr->data[address] = (uint8_t)(emulator->random >> 24);
    }
}

struct emulator *emulator_create(const char *elf_path, uint32_t seed) {
    elf_firmware_t program = {0};
    struct emulator *emulator = calloc(1, sizeof *emulator);
    avr_global_logger_set(no_log);
    if (!emulator || elf_read_firmware(elf_path, &program) != 0) {
        free(emulator);
        return NULL;
    }
    emulator->avr = avr_make_mcu_by_name("atmega328p");
    avr_init(emulator->avr);
    emulator->avr->frequency = EMULATOR_HZ;
    program.frequency = EMULATOR_HZ;
    avr_load_firmware(emulator->avr, &program);
    emulator->avr->sleep = no_sleep;
    emulator->random = seed;
    emulator->twi.slaves[0] = &emulator->top.slave;
    emulator->twi.slaves[1] = &emulator->bottom.slave;
    emulator->twi.slaves[2] = &emulator->dac.slave;
    uart_attach(emulator);
    twi_attach(emulator);
    spi_attach(emulator);
    pins_attach(emulator);
    probes_attach(emulator);
    emulator->safety = find_vector(emulator->avr, TIMER1_COMPA);
    hook_write(emulator, TIMSK1, write_mask);
    emulator->io = (avr_io_t){.kind = "board", .reset = on_reset};
    avr_register_io(emulator->avr, &emulator->io);
    emulator_reset(emulator, RESET_POWER);
    return emulator;
}

void emulator_destroy(struct emulator *emulator) {
    if (!emulator) {
        return;
    }
    emulator->avr->io_port = emulator->io.next; /* ours is not on the heap of simavr */
    avr_terminate(emulator->avr);
    free(emulator->avr);
    free(emulator);
}

void emulator_reset(struct emulator *emulator, int cause) {
    static const uint8_t flags[] = {EXTRF, BORF, PORF | BORF};
    if (cause == RESET_POWER) {
        power_up_chips(emulator);
    }
    avr_reset(emulator->avr);
    if (cause == RESET_POWER) {
        scramble_ram(emulator);
    }
    emulator->avr->data[MCUSR] = flags[cause];
    emulator->crashed = false;
    probes_reset(emulator);
}

static void show_world(struct emulator *emulator) {
    struct emulator_world *world = &emulator->world;
    avr_irq_t *input = avr_io_getirq(emulator->avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0);
    emulator->shunt_v = world->current_a * world->shunt_ohm;
    emulator->dac.slave.absent = world->dac_absent;
    emulator->top.slave.absent = world->top_meter_absent;
    emulator->bottom.slave.absent = world->bottom_meter_absent;
    avr_raise_irq(input, (uint32_t)(world->displacement_v * 1000.0 * 1024 / 1023 + 0.5)); /* simavr divides by 1023 */
}

static void step(struct emulator *emulator) {
    avr_t *avr = emulator->avr;
    bool resets = avr->data[MCUSR] & WDRF;
    int state = avr_run(avr);
    probes_step(emulator);
    emulator->crashed = state == cpu_Crashed || state == cpu_Done;
    if (!resets && avr->data[MCUSR] & WDRF) {
        probes_reset(emulator);
    }
}

int emulator_run(struct emulator *emulator, uint64_t cycle) {
    avr_t *avr = emulator->avr;
    show_world(emulator);
    if (emulator->world.unpowered && cycle > avr->cycle) {
        emulator_reset(emulator, RESET_POWER);
        avr->cycle = cycle;
    }
    emulator->target = cycle;
    limit_run(emulator);
    while (avr->cycle < cycle && !emulator->crashed) {
        step(emulator);
    }
    return emulator->crashed ? -1 : 0;
}

int emulator_step(struct emulator *emulator, uint64_t count) {
    show_world(emulator);
    while (count-- && !emulator->crashed) {
        step(emulator);
    }
    return emulator->crashed ? -1 : 0;
}

double emulator_sink_a(const struct emulator *emulator) {
    bool off = !emulator->enabled || emulator->world.unpowered || emulator->dac.code & 0x3000;
    return off ? 0.0 : emulator->world.full_scale_a * (emulator->dac.code & 0xFFF) / 4096.0;
}

void emulator_write_eeprom(struct emulator *emulator, uint16_t address, uint8_t *bytes, uint16_t count) {
    avr_eeprom_desc_t part = {.ee = bytes, .offset = address, .size = count};
    avr_ioctl(emulator->avr, AVR_IOCTL_EEPROM_SET, &part);
}

struct emulator_world *emulator_world(struct emulator *emulator) { return &emulator->world; }

struct emulator_probes *emulator_probes(struct emulator *emulator) { return &emulator->probes; }

uint8_t *emulator_ram(struct emulator *emulator) { return emulator->avr->data; }

uint64_t emulator_cycle(const struct emulator *emulator) { return emulator->avr->cycle; }
