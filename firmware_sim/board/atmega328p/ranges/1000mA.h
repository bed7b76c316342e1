/* Wires of 0.1 to 0.2 mm. docs/board.md, "Ranges". */
#ifndef SUPPLY_LIMIT
#define SUPPLY_LIMIT 10000u      /* the highest set current, 0.1 mA */
#endif
#define SOURCE_FULL_SCALE 10240u /* current at the DAC code 4096, 0.1 mA */
#define SHUNT_MICROOHM 50000u    /* of the upper meter: 1.6 A at 81.9 mV */
