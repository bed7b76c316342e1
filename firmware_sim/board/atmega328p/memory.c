/* Before any variable exists, every byte of the RAM is tested with two patterns and gets its content back. The content
 * is random after power-up, and after other resets it is what the program has left, so a sum over it differs from start
 * to start. The watchdog is still running at its shortest time (15 ms) if it has caused the reset, so it is stopped
 * first (ATmega328P data sheet, chapter "Watchdog Timer"). The test needs 6 ms.
 */
#include "memory.h"

#include <avr/io.h>
#include <avr/wdt.h>

static bool good __attribute__((section(".noinit")));
static uint16_t sum __attribute__((section(".noinit")));

static void __attribute__((noinline, used)) test(void) {
    uint16_t total = 0;
    bool passed = true;
    MCUSR = 0;
    wdt_disable();
    for (uint8_t volatile *at = (uint8_t *)RAMSTART; at <= (uint8_t *)RAMEND; at++) {
        uint8_t content = *at;
        total = (uint16_t)((total << 5 | total >> 11) + content);
        *at = 0x55;
        passed &= *at == 0x55;
        *at = 0xAA;
        passed &= *at == 0xAA;
        *at = content;
    }
    good = passed;
    sum = total;
}

void __attribute__((naked, used, section(".init3"))) memory_begin(void);

void memory_begin(void) { __asm__ volatile("rcall %x0" : : "i"(test)); }

bool memory_is_good(void) { return good; }

uint16_t memory_random(void) { return sum; }
