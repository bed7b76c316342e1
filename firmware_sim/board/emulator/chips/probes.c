/* Cycle probes: the safety interrupt is the compare match A of timer 1. */
#include "parts.h"

static void on_match(struct avr_irq_t *irq, uint32_t value, void *param) {
    struct emulator *emulator = param;
    (void)irq;
    if (value) {
        emulator->matched_at = emulator->avr->cycle;
    }
}

static void on_entry(struct emulator *emulator) {
    struct emulator_probes *probes = &emulator->probes;
    uint64_t latency = emulator->avr->cycle - emulator->matched_at;
    emulator->entered_at = emulator->avr->cycle;
    if (probes->safety_count == 0 || latency < probes->safety_latency_min) {
        probes->safety_latency_min = latency;
    }
    if (latency > probes->safety_latency_max) {
        probes->safety_latency_max = latency;
    }
    probes->safety_count++;
}

static void on_running(struct avr_irq_t *irq, uint32_t value, void *param) {
    struct emulator *emulator = param;
    (void)irq;
    if (value) {
        on_entry(emulator);
        return;
    }
    uint64_t length = emulator->avr->cycle - emulator->entered_at;
    if (length > emulator->probes.safety_longest) {
        emulator->probes.safety_longest = length;
    }
}

void probes_attach(struct emulator *emulator) {
    avr_irq_t *irq = avr_get_interrupt_irq(emulator->avr, TIMER1_COMPA);
    avr_irq_register_notify(irq + AVR_INT_IRQ_PENDING, on_match, emulator);
    avr_irq_register_notify(irq + AVR_INT_IRQ_RUNNING, on_running, emulator);
}

void probes_reset(struct emulator *emulator) {
    emulator->interrupts_used = false;
    emulator->disabled_since = 0;
    if (emulator->avr->data[MCUSR] & 0x08) {
        emulator->probes.resets_by_watchdog++;
    }
}
