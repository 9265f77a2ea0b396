/* SPDX-License-Identifier: MIT */
/* The SICK scanners that CoLa speaks for, as a table of rows. COLA.md has the table for readers, with sources. */
#ifndef DRIVERS_PROTOCOL_COLA_MODEL_H
#define DRIVERS_PROTOCOL_COLA_MODEL_H

#include <stdint.h>

/* Forms of LIDinputstate and LIDoutputstate. */
enum cola_ports {
    COLA_PORTS_TIM, /* version 0, no time of day; an event comes only with a change */
    COLA_PORTS_LMS, /* version 1, unused ports are marked, outputs have a time of day; sEN LIDoutputstate 1 brings one
                     * event at once */
};

struct cola_model {
    const char *model;    /* of the head profile; NULL: the row for all others, with the profile's own text */
    const char *version;  /* of DeviceIdent, where the profile has no firmware */
    const char *firmware; /* of FirmwareVersion, where DeviceIdent has `version`; else both have the same text */
    uint8_t echoes;       /* DIST1, DIST2 */
    uint8_t rssi;         /* LMDscandatacfg at power-up: 1 with RSSI */
    uint8_t rssi_16bit;   /* 0: 8 bit */
    uint8_t n_fields;     /* field000 and on are answered */
    uint8_t n_records;    /* the first of them have a record, the others say that there is none */
    uint8_t named;        /* 1: the record of an empty field has number, name and a segmented part; 0: none of them */
    uint8_t n_results;    /* of LFErec */
    uint8_t n_outputs;    /* of LIDoutputstate */
    uint8_t ports;        /* enum cola_ports */
};

/* The row of that model; never NULL. */
const struct cola_model *cola_model_find(const char *model);

#endif
