/* SPDX-License-Identifier: MIT */
/* Private to the files of this folder: parts of a line, numbers, the rows of the table. */
#ifndef FIRMWARE_SIM_COMMAND_COMMAND_INSIDE_H
#define FIRMWARE_SIM_COMMAND_COMMAND_INSIDE_H

#include "firmware_sim/command/command.h"

enum {
    COMMAND_TEXT_LEN = sizeof(((struct command_queue *)0)->entry[0].text),
    COMMAND_CLIP_LEN = 36, /* length of the part of a line that an error quotes, with its NUL */
};

/* ---- error_queue.c */

/* Composes `standard text; text`. Bytes that are not printable ASCII become '~', and '"' becomes '\''. Cut at its end
 * to fit. */
void command_error_compose(char *buf, size_t len, int number, const char *text);

/* ---- parse.c */

/* A line in its parts; header and param point into text. */
struct command_request {
    char text[COMMAND_MAX_LINE + 1];
    const char *header; /* without a leading colon and the '?' */
    size_t header_len;
    int query;
    char *param; /* the rest without blanks around it; "" when there is none */
};

/* Returns 0, or the error number and its reason. A blank line gives header_len 0 and 0. */
int command_split(const char *line, struct command_request *req, const char **why);

/* Whether a header matches a pattern of SCPI-99 6.2.1: the upper-case part or the whole of each word, in any
 * case. Words in brackets may be left out. */
int command_header_matches(const char *pattern, const char *header, size_t len);

/* Whether a whole word matches one word of a pattern ("MINimum"). */
int command_word_matches(const char *pattern, const char *word);

/* A decimal number as it was written: +-digits * 10^exponent. Digits have no zeros at either end; 0 has no
 * digits. */
struct command_decimal {
    char digits[COMMAND_MAX_LINE + 1];
    int n_digits, exponent, negative;
};

/* NRf of IEEE 488.2, 7.7.2. Returns what follows the number and its blanks, or NULL when text is not a
 * number. */
const char *command_parse_decimal(const char *text, struct command_decimal *decimal);

enum command_fit { COMMAND_FIT_EXACT, COMMAND_FIT_FINE, COMMAND_FIT_BIG };
/* number * 10^shift as an integer. FINE: it has a fraction; BIG: it needs more than 63 bits. */
enum command_fit command_decimal_to_int(const struct command_decimal *decimal, int shift, int64_t *value);

/* value * 10^-decimals without superfluous zeros: 300000, -0.5. */
void command_format_fixed(char *buf, size_t len, int64_t value, int decimals);

/* The beginning of text, with "..." where it is cut. */
void command_clip(char clip[COMMAND_CLIP_LEN], const char *text, size_t len);

/* ---- commands.c */

struct command_unit {
    const char *name;     /* as errors print it; "" for a plain count */
    int decimals;         /* the integer counts 10^-decimals of the unit */
    const char *suffixes; /* as errors list them */
    struct {
        const char *suffix;
        int shift; /* power of ten to the unit */
    } suffix[4];
};

/* A bound. If it is the profile's, value is the offset in struct head_limits. Else value is the bound itself. */
struct command_bound {
    int of_profile;
    int64_t value;
};

struct command_call;

/* A setting that is computed from others, and that sets these. Values are integers in its row's unit. */
struct command_derived {
    /* Why this head has no such setting; NULL: it has. */
    const char *(*why_not)(const struct command_device *dev);
    int64_t (*read)(const struct command_device *dev, const struct head_settings *settings);
    /* The range that can be set now; min == max: it can only be read. */
    void (*range)(const struct command_device *dev, int64_t *min, int64_t *max);
    /* The reason for that range: " as HEAD:PRR is 300000"; "" if there is none. */
    void (*because)(const struct command_device *dev, char *text, size_t len);
    /* Into dev->settings; returns -1 when it failed. The value is within the range. */
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

enum command_value_kind {
    COMMAND_VALUE_NUMBER,
    COMMAND_VALUE_WORD,
    COMMAND_VALUE_MIN,
    COMMAND_VALUE_MAX,
    COMMAND_VALUE_DEF
};

struct command_value {
    enum command_value_kind kind;
    struct command_decimal decimal;
    int shift; /* of the suffix */
    uint32_t word;
};

struct command_call {
    struct command_device *dev;
    uint32_t session;
    const struct command_row *row;
    char *param;      /* as written; of a step, up to the pose */
    const char *pose; /* what follows the step; NULL: nothing */
    struct command_value value;
    struct command_result *out;
};

struct command_row {
    const char *header;
    /* Both return 0, or -1 when the command failed. */
    int (*query)(struct command_call *call); /* NULL: no query form */
    int (*act)(struct command_call *call);   /* NULL: only a query */
    const struct command_unit *unit;         /* of act's one number; NULL: act takes none */
    const struct command_setting *setting;   /* NULL: MIN, MAX and DEF have no meaning */
    int open;                                /* act is open to all sessions */
    int pose;                                /* a pose may follow the number */
    int own;                                 /* both forms take their parameters themselves */
    int word;                                /* the query may have a word, in param */
    int event; /* of an action that depends on the state: enum head_event + 1; 0: it doesn't */
};

extern const struct command_row command_rows[]; /* up to one without a header */

/* MIN, MAX or DEF; 0 when the parameter is none of them. */
int command_parse_special(const char *param, enum command_value_kind *kind);

/* step_pose.c: call->pose as six numbers into call->out. Returns -1 when it failed. */
int command_take_pose(struct command_call *call);

/* site_pose.c */
extern const struct command_unit command_unit_place;
int command_place_query(struct command_call *call);
int command_place_change(struct command_call *call);

/* fault_commands.c */
extern const struct command_unit command_unit_fault;
int command_fault_add(struct command_call *call);
int command_fault_clear(struct command_call *call);
int command_fault_injected(struct command_call *call);
int command_fault_list(struct command_call *call);

/* Queues the error and makes it the reply. Returns -1. */
int command_fail(struct command_call *call, int number, const char *fmt, ...) __attribute__((format(printf, 3, 4)));

/* Returns 0. */
int command_reply(struct command_call *call, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

/* ---- setting.c: query and change of any setting */
int command_setting_query(struct command_call *call);
int command_setting_change(struct command_call *call);

/* The present range: as the profile and other settings leave it. */
void command_setting_range(const struct command_call *call, int64_t *min, int64_t *max);
/* The index of the last word that the head takes. */
uint32_t command_setting_last_word(const struct command_call *call);
/* The only values that a setting takes, rising: pulse rates of programs, rates or steps of geometries. Returns how
 * many; 0: it takes any value in its range. */
uint32_t command_setting_values(const struct command_call *call, int64_t value[HEAD_MAX_RATES]);
/* Whether it can be set in a state. */
int command_setting_is_free(const struct command_device *dev, const struct command_setting *setting,
                            enum head_state state);

/* ---- step.c: angular steps, which follow from the rates */
/* The angle of a step in nano-degrees, for a number of steps per turn. */
int64_t command_step_ndeg(uint32_t steps);
extern const struct command_derived command_step_both, command_step_line, command_step_pan;

/* ---- help.c */
int command_help(struct command_call *call);
int command_help_settings(struct command_call *call);

/* The number in call->value in the row's unit. Outside of the range: -222 with the allowed range, and returns -1. */
int command_value_in_range(struct command_call *call, int64_t min, int64_t max, int64_t *value);

#endif
