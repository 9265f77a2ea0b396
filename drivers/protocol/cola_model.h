/* The SICK scanners that CoLa speaks for, as a table of rows. COLA.md has it for readers, with sources. */
#ifndef DRIVERS_PROTOCOL_COLA_MODEL_H
#define DRIVERS_PROTOCOL_COLA_MODEL_H

#include <stdint.h>

struct cola_model {
    const char *model;    /* of the head profile; NULL: the row for all others, with the profile's own text */
    const char *version;  /* of DeviceIdent, where the profile has no firmware */
    const char *firmware; /* what FirmwareVersion says where the version is that one; else it says the version */
    uint8_t echoes;       /* DIST1, DIST2 */
    uint8_t rssi;         /* LMDscandatacfg at power-up: 1 with RSSI */
    uint8_t rssi_16bit;   /* 0: 8 bit */
    uint8_t n_fields;     /* field000 .. */
};

/* The row of that model; never NULL. */
const struct cola_model *cola_model_find(const char *model);

#endif
