/* libmodbus as master: client rtu PATH|tcp PORT UNIT COMMAND...
     read ADDRESS COUNT             prints the holding registers
     write ADDRESS VALUE...         FC06 for one, FC16 for several
     exchange ADDRESS VALUE... / ADDRESS COUNT      FC23, prints what it read
     rate N                         N times FC23 (write 4, read 8): prints the seconds they took */
#include <errno.h>
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static uint16_t words[125], written[123];

static int check(int result)
{
    if (result < 0) {
        printf("%s\n", modbus_strerror(errno));
        exit(3);
    }
    return result;
}

static void show(int count)
{
    for (int i = 0; i < count; i++)
        printf("%d ", words[i]);
    putchar('\n');
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

int main(int argc, char **argv)
{
    modbus_t *bus = strcmp(argv[1], "rtu") ? modbus_new_tcp("127.0.0.1", atoi(argv[2]))
                                           : modbus_new_rtu(argv[2], 115200, 'N', 8, 1);
    modbus_set_slave(bus, atoi(argv[3]));
    modbus_set_response_timeout(bus, 2, 0);
    check(modbus_connect(bus));
    char **arg = argv + 5, **end = argv + argc;
    int count = 0, address = atoi(*arg++);
    if (!strcmp(argv[4], "read")) {
        show(check(modbus_read_registers(bus, address, atoi(*arg), words)));
    } else if (!strcmp(argv[4], "write")) {
        while (arg < end)
            written[count++] = atoi(*arg++);
        check(count == 1 ? modbus_write_register(bus, address, written[0])
                         : modbus_write_registers(bus, address, count, written));
    } else if (!strcmp(argv[4], "exchange")) {
        for (; strcmp(*arg, "/"); arg++)
            written[count++] = atoi(*arg);
        show(check(modbus_write_and_read_registers(bus, address, count, written, atoi(arg[1]), atoi(arg[2]), words)));
    } else {
        double began = now();
        for (int i = 0; i < address; i++) {
            written[0] = i;
            check(modbus_write_and_read_registers(bus, 0, 4, written, 0, 8, words));
        }
        printf("%.6f\n", now() - began);
    }
    modbus_close(bus);
    return 0;
}
