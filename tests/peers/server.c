/* A register memory served by libmodbus: server rtu|tcp UNIT [ADDRESS=VALUE...]
   Prints where it serves: the path of a pseudo-terminal, or a TCP port of this machine. */
#define _GNU_SOURCE
#include <errno.h>
#include <modbus.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static modbus_mapping_t *memory;

static void fill(int count, char **settings)
{
    for (int i = 0; i < count; i++) {
        unsigned address, value;
        if (sscanf(settings[i], "%u=%u", &address, &value) == 2)
            memory->tab_registers[address] = memory->tab_input_registers[address] = value;
    }
}

static void serve(modbus_t *bus, int lasting)
{
    uint8_t query[MODBUS_MAX_ADU_LENGTH];
    for (;;) {
        int size = modbus_receive(bus, query);
        if (size > 0)
            modbus_reply(bus, query, size, memory);
        else if (size < 0 && !lasting)
            return;
        else if (size < 0 && errno != EMBBADCRC)
            usleep(1000); /* nobody at the other end of the terminal */
    }
}

int main(int argc, char **argv)
{
    int unit = atoi(argv[2]);
    memory = modbus_mapping_new(100, 100, 1000, 1000);
    fill(argc - 3, argv + 3);
    if (strcmp(argv[1], "rtu") == 0) {
        modbus_t *bus = modbus_new_rtu("/dev/ptmx", 115200, 'N', 8, 1); /* the near end of a new terminal */
        modbus_set_slave(bus, unit);
        if (modbus_connect(bus) || grantpt(modbus_get_socket(bus)) || unlockpt(modbus_get_socket(bus)))
            return 1;
        puts(ptsname(modbus_get_socket(bus)));
        fflush(stdout);
        serve(bus, 1);
    }
    modbus_t *bus = modbus_new_tcp("127.0.0.1", 0);
    modbus_set_slave(bus, unit);
    int listener = modbus_tcp_listen(bus, 1);
    struct sockaddr_in address;
    socklen_t size = sizeof address;
    if (listener < 0 || getsockname(listener, (struct sockaddr *)&address, &size))
        return 1;
    printf("%d\n", ntohs(address.sin_port));
    fflush(stdout);
    while (modbus_tcp_accept(bus, &listener) >= 0) {
        serve(bus, 0);
        modbus_close(bus);
    }
    return 0;
}
