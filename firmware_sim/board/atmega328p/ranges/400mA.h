/* Wires of 0.05 to 0.1 mm. docs/board.md, "Ranges". */
#ifndef SUPPLY_LIMIT
#define SUPPLY_LIMIT 4000u
#endif
#define SOURCE_FULL_SCALE 4096u
#define SHUNT_MICROOHM 120000u /* 683 mA at 81.9 mV */
