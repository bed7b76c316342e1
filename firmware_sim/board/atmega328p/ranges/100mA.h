/* Wires of 0.025 to 0.05 mm. docs/board.md, "Ranges". */
#ifndef SUPPLY_LIMIT
#define SUPPLY_LIMIT 1000u
#endif
#define SOURCE_FULL_SCALE 1024u
#define SHUNT_MICROOHM 500000u /* 164 mA at 81.9 mV */
