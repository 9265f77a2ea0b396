/* SPDX-License-Identifier: MIT */
/* Settings. Each one is a field of struct head_settings, or is computed from fields, and has a range. */
#ifndef FIRMWARE_SIM_COMMAND_SETTING_H
#define FIRMWARE_SIM_COMMAND_SETTING_H

#include <stddef.h>
#include <stdint.h>

#include "firmware_sim/command/command.h"

struct command_call;

/* A bound. If it is the profile's, value is the offset in struct head_limits. Else value is the bound itself. */
struct command_bound {
    int of_profile;
    int64_t value;
};

/* A setting that is computed from others, and that sets these. Values are integers in its row's unit. */
struct command_derived {
    /* Why this head has no such setting; NULL: it has. */
    const char *(*why_not)(const struct command_device *dev);
    int64_t (*read)(const struct command_device *dev, const struct head_settings *settings);
    /* The range that can be set now; min == max: it can only be read. */
    void (*range)(const struct command_device *dev, int64_t *min, int64_t *max);
    /* The reason for that range: " as HEAD:PRR is 300000"; "" if there is none. */
    void (*because)(const struct command_device *dev, char *text, size_t len);
    /* Into dev->settings; returns -1 when it failed. The value is within the range, but DEF may be beyond it. */
    int (*write)(struct command_call *call, int64_t value);
};

/* A setting, its range from the profile, and the setting that narrows it: other + least <= value <= other +
 * most. */
struct command_setting {
    size_t offset;   /* in struct head_settings */
    int is_u32;      /* the setting and its bounds are uint32_t, not int64_t */
    int not_in_scan; /* fixed from spin-up to the end of the scan */
    struct command_bound min, max;
    const char *other; /* header of the other setting; NULL: none */
    size_t other_offset;
    int64_t least, most;                   /* COMMAND_UNBOUND: no such bound */
    int is_rate;                           /* a head with fixed pulse rates takes only these */
    const char *const *words;              /* the values by name, from 0; NULL: values are numbers */
    const struct command_derived *derived; /* NULL: it is a field of the settings */
};
#define COMMAND_UNBOUND INT64_MIN

/* Query and change of any setting. */
int command_setting_query(struct command_call *call);
int command_setting_change(struct command_call *call);

/* 0: a recording is replayed that does not have the setting. */
int command_setting_is_known(const struct command_call *call);
/* Returns the index of the last word that the head takes. */
uint32_t command_setting_last_word(const struct command_call *call);
/* The only values that a setting takes, rising: pulse rates of programs, rates or steps of geometries. Returns how
 * many; 0: it takes any value in its range. */
uint32_t command_setting_values(const struct command_call *call, int64_t value[HEAD_MAX_RATES]);
/* Whether it can be set in a state. */
int command_setting_is_free(const struct command_device *dev, const struct command_setting *setting,
                            enum head_state state);

/* Gives the number in call->value in the row's unit. Outside of the range it returns -1, after error -222 with the
 * allowed range. A number that is too fine for the unit fails in the same way, with the allowed multiples. */
int command_value_in_range(struct command_call *call, int64_t min, int64_t max, int64_t *value);

#endif
