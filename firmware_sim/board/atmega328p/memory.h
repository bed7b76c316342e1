/* The RAM at power-up: a test, and a random number from its content. */
#ifndef MEMORY_H
#define MEMORY_H

#include <stdbool.h>
#include <stdint.h>

bool memory_is_good(void);
uint16_t memory_random(void);

#endif
