/* SPDX-License-Identifier: MIT */
/* Monitored fields of the configuration: the keys as they are written. From the keys, fields.c makes the
 * fields that protocols evaluate (drivers/protocol/cola_field.h). Metres and degrees, in the head's frame; angles as
 * SICK counts them: 0 right, 90 forward. */
#ifndef FIRMWARE_SIM_CONFIG_FIELDS_H
#define FIRMWARE_SIM_CONFIG_FIELDS_H

#include <stdint.h>

struct cfg_reader;
struct cola_field;
struct cola_fields;
struct config;

enum { CONFIG_MAX_FIELDS = 48, CONFIG_MAX_POINTS = 62 };
enum config_field_shape { FIELD_POLYGON, FIELD_SEGMENT, FIELD_RECTANGLE };

/* The value of a key of CFG_POINTS. */
struct config_points {
    uint32_t n;
    double at[CONFIG_MAX_POINTS][2];
};

struct config_field {
    uint32_t number; /* from 1 */
    char name[32];
    enum config_field_shape shape;
    struct config_points points_m;
    double angles_deg[2], radii_m[2];
    double corner_m[2], size_m[2], turn_deg;
    uint32_t response_ms, output;
    double blanking_m;
};

/* A digital input is active from one device time to another. */
enum { CONFIG_MAX_INPUTS = 64 };
struct config_input {
    uint32_t input; /* from 1 */
    double from_s, until_s;
};

/* Checks the keys of fields and inputs against each other. */
void cfg_check_fields(struct cfg_reader *rd, const struct config *cfg);
/* Makes one field with its shape. */
void config_make_field(const struct config_field *from, struct cola_field *out);
/* Fills in the fields, by their numbers, and the inputs. The configuration must have been checked. */
void config_fill_fields(const struct config *cfg, struct cola_fields *out);

#endif
