/* SPDX-License-Identifier: MIT */
/* Hokuyo models: identity, texts and commands of each over SCIP, one row per model, in scip_model.c.
 * Geometry, ranges and speed are not here: they come from the stream. Constant data; any thread. */
#ifndef DRIVERS_PROTOCOL_SCIP_MODEL_H
#define DRIVERS_PROTOCOL_SCIP_MODEL_H

#include <stdint.h>

enum scip_feature {
    SCIP_INTENSITY = 1 << 0,      /* GE ME */
    SCIP_MULTI_ECHO = 1 << 1,     /* HD ND, and HE NE with intensity */
    SCIP_MOTOR_SPEED = 1 << 2,    /* CR; else 04 */
    SCIP_BIT_RATE = 1 << 3,       /* SS; else 0F, as Ethernet models */
    SCIP_REBOOT = 1 << 4,         /* RB RT */
    SCIP_SLEEP = 1 << 5,          /* %SL */
    SCIP_SIMULATION = 1 << 6,     /* DB; else 04 */
    SCIP_TIME_ALONE = 1 << 7,     /* in the time mode nothing but TM is taken, and TM1 is taken only there */
    SCIP_TIME_HEX = 1 << 8,       /* TIME of II is six hexadecimal digits; else four characters */
    SCIP_STATE = 1 << 9,          /* %ST */
    SCIP_TIME_US = 1 << 10,       /* %TM %MD %ME: times in microseconds; only with some firmware */
    SCIP_FIRST_AT_ONCE = 1 << 11, /* no turn is left out before the first scan of a stream */
};

struct scip_model {
    const char *name;    /* the profile's `model`; NULL: all others */
    const char *vendor;  /* VEND; NULL: the profile's maker */
    const char *product; /* PROD; NULL: the profile's model */
    const char *model;   /* MODL; NULL: the profile's model */
    const char *protocol;
    uint32_t features;
    uint32_t bit_rate;                                    /* of power-up, bit/s */
    const char *link;                                     /* SBPS; NULL: the bit rate */
    const char *speed_before, *speed_after;               /* SCSP: around the number */
    const char *at_default;                               /* printed after a speed or bit rate that is as at power-up */
    const char *mode_idle, *mode_single, *mode_streaming; /* MESM */
    const char *mode_booting, *mode_fault;
    const char *works;                     /* STAT in normal operation, as clients look for it */
    const char *boots, *has_failed;        /* STAT in a boot, and in the state fault */
    uint16_t no_object, too_near, no_step; /* instead of a range */
};

/* Returns the features of a model with this version of its firmware, as bits of enum scip_feature. */
uint32_t scip_model_features(const struct scip_model *model, const char *firmware);
/* Never NULL. */
const struct scip_model *scip_model_find(const char *model);

#endif
