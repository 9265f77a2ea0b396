/* SPDX-License-Identifier: MIT */
/* One session of CoLa, for the files of this module. COLA.md says what a session does and doesn't. */
#ifndef DRIVERS_PROTOCOL_COLA_H
#define DRIVERS_PROTOCOL_COLA_H

#include "drivers/protocol/cola_model.h"
#include "drivers/protocol/cola_telegram.h"
#include "drivers/protocol/cola_units.h"
#include "drivers/protocol/cola_watch.h"
#include "drivers/protocol/cola_way.h"
#include "drivers/protocol/protocol.h"
#include "drivers/protocol/scan_wish.h"

enum {
    /* sick_tim takes at most 65535 bytes a transfer. The longest telegram: two distances and two signals of each beam
     * as hexadecimal (5 bytes each), and less than 1000 bytes around them. */
    COLA_MAX_UNIT = 4 * 5 * PLANAR_MAX_STEPS + 1000,
    COLA_MAX_NAME = 32,
    COLA_MOST_WAITING = 100,
    COLA_MOST_ARGS = 12, /* of LMDscandatacfg */
};

/* Levels of access. */
enum cola_level { COLA_RUN = 1, COLA_MAINTENANCE = 2, COLA_CLIENT = 3, COLA_SERVICE = 4 };

/* Settings of the client. They begin as at power-up, and do so again after a reboot. */
struct cola_settings {
    /* LMDscandatacfg */
    uint8_t channels[2], rssi, rssi_16bit, unit, encoder[2], position, name, comment, time;
    uint16_t every; /* n: each n-th scan is sent */
    /* LMPoutputRange, 1/10000 deg: angles of beams. Without `narrowed` all beams are sent. */
    int32_t start_e4, stop_e4;
    uint8_t narrowed;
    uint8_t filter; /* FREchoFilter: enum cola_echoes */
    uint32_t scale; /* LMDscandatascalefactor; 0: the geometry's */
    char location[COLA_MAX_NAME];
    uint8_t framing; /* EIHstCola, as written or stored: enum cola_form */
};

struct cola {
    struct protocol_spec spec; /* its `stored` is valid in set_up (cola.c) only */
    const struct cola_model *model;
    struct cola_settings set;
    char stored[PROTOCOL_STORED]; /* what mEEwriteall has kept */
    uint8_t power_framing;        /* EIHstCola at power-up, as configured or stored */
    enum cola_level level;
    int measures;            /* 0 after LMCstopmeas: no output, of this session alone */
    int started;             /* LMCstartmeas was called after the last LMCstopmeas */
    int reboots;             /* it reboots once the answer is sent */
    struct planar_head head; /* where the head has several geometries: that of its next scan */
    struct {
        int is_due; /* mLMPsetscancfg is to be done and answered once the head's scan has ended */
        enum cola_form form;
        int64_t lines_uhz;
        uint32_t steps;
    } next;
    int rests;       /* the stream said last that the head does not scan: its scans have all come */
    uint32_t field;  /* number in the name of the request at hand, field012 */
    int outputs_due; /* LIDoutputstate is sent once, after the answer */
    struct {         /* the events that the client switched on, and the set of fields that is watched */
        int results, outputs, inputs;
        uint8_t by_telegram; /* FieldSetSelectionMethod */
        uint16_t set;        /* ActiveFieldSet, from 1 */
        uint32_t seen;       /* inputs when they were last looked at, a bit each */
        uint32_t changed_us; /* when they changed, as the scanner counts time */
        int64_t next_ns;     /* device time of their next change; INT64_MAX: none */
    } ports;
    struct cola_fields fields;
    struct cola_watch watch;
    struct scan_wish wish;
    int64_t try_ns; /* when to look at the head next while the wish lasts */
    int64_t now_ns;
    int streams;                             /* sEN LMDscandata 1 */
    enum cola_form stream_form;              /* of telegrams without a request */
    int pending;                             /* a scan is done and not yet looked at */
    uint32_t since_sent;                     /* scans since one was sent */
    uint32_t n_waiting;                      /* polls (sRN LMDscandata) that wait for the next scan */
    uint8_t waiting_form[COLA_MOST_WAITING]; /* the form in which each is answered */
    uint16_t telegrams;                      /* counter of LMDscandata */
    struct cola_input input;
    struct cola_args args; /* the values of the request at hand, and read into numbers */
    uint32_t arg[COLA_MOST_ARGS];
    struct cola_out out; /* the answer to it, in `unit` */
    struct planar_scan scan;
    struct cola_way way;
    struct cola_encoder encoder_now, encoder; /* of the turn at hand, and of the last whole one */
    uint8_t unit[COLA_MAX_UNIT];
};

/* Carries out a request: takes its values from `arg`, and writes those of the answer to `out`. Returns COLA_OK,
 * COLA_LATER or an error. */
typedef enum cola_error cola_handler(struct cola *self);

static inline int cola_is_measuring(const struct cola *self)
{
    return self->measures && (self->started || self->streams);
}

/* cola.c */

/* Sends a scan that is done, if the client polled for it or streams, and evaluates the fields. */
void cola_deliver(struct cola *self);
/* sRN LMDscandata: answers with the last scan. Where there is none in the present geometry, the next scan answers. */
cola_handler cola_read_scan;
/* Sets the session and its settings as at power-up. SH_EINPUT: what is stored is wrong. */
int cola_power_up(struct cola *self, struct sh_err *err);

/* Device time as the scanner counts it: us, 32 bits. */
uint32_t cola_time_us(const struct cola *self, int64_t t_ns);

/* cola_lmd.c */

/* Writes the values of LMDscandata after the head of the telegram. Only to be called where there is a last scan. */
void cola_put_scan(const struct cola *self, struct cola_out *out);

/* cola_checksum.c: for protocol_ops of the same names */

/* Marks the bits of distances and signals of LMDscandata, which may be changed. */
void cola_content(const uint8_t *unit, size_t len, uint8_t *mask);
/* Makes the check byte of CoLa-B right. */
void cola_reseal(uint8_t *unit, size_t len);

/* cola_settings.c: requests about the measurement. */

void cola_settings_reset(struct cola *self);
/* The beams that are sent: those that LMPoutputRange selects. head->known must be 1. */
struct cola_beams {
    uint32_t first, n;
};
struct cola_beams cola_sent_beams(const struct cola *self, const struct planar_head *head);
cola_handler cola_read_output_range, cola_write_output_range, cola_read_scan_data_cfg, cola_write_scan_data_cfg,
    cola_read_filter, cola_write_filter, cola_read_scale, cola_write_scale;

/* The numbers of LMDscandatacfg in its order, but for the last one, `every`. */
enum { COLA_CFG_BYTES = 11 };
void cola_list_cfg(struct cola_settings *s, uint8_t *bytes[COLA_CFG_BYTES]);
/* Whether the model has these channels, and all values are allowed. */
int cola_scan_data_fits(const struct cola *self, const struct cola_settings *s);
/* Whether the model has that FREchoFilter. */
int cola_filter_fits(const struct cola *self, uint32_t filter);

/* cola_stored.c */

/* Takes over what is stored. */
int cola_restore(struct cola *self, struct sh_err *err);
cola_handler cola_keep;

/* cola_dialect.c */

/* The value of EIHstCola now, and as configured (CoLa-A where no dialect is chosen): enum cola_form. */
uint32_t cola_framing(const struct cola *self);
uint32_t cola_configured_framing(const struct cola *self);
int cola_understands(const struct cola *self, enum cola_form form);
/* Gives telegrams without a request the link's dialect, which another session may have changed. */
void cola_follow_dialect(struct cola *self);
cola_handler cola_read_framing, cola_write_framing;

/* cola_geometry.c: line rate and step, which belong to the head, not to this session. */

/* The head with its present settings. The last scan, in scan.head, may have another step. */
const struct planar_head *cola_head(const struct cola *self);
/* Asks the head for its settings; to be called before each request. */
void cola_look_at_head(struct cola *self);
/* An event of the stream, or a gap in it (NULL), which may have had the event that is waited for. */
void cola_geometry_event(struct cola *self, const struct native_event *event);
/* Time has passed: answers mLMPsetscancfg once the head's scan has ended. */
void cola_geometry_time(struct cola *self);
cola_handler cola_read_scan_cfg, cola_set_scan_cfg;

/* cola_ports.c: fields, inputs and outputs. */

/* 12 of "field012"; UINT32_MAX: another name. */
uint32_t cola_field_number(const char *name);
/* cola_read_field and cola_write_field read and write the field whose number is in `field`. Reading answers with a
 * record, or with a single 0 for a field beyond the model's n_records. */
cola_handler cola_read_field, cola_write_field;
cola_handler cola_read_inputs, cola_read_outputs, cola_read_field_results, cola_read_set_method, cola_write_set_method,
    cola_read_set, cola_write_set, cola_set_results_event, cola_set_outputs_event, cola_set_inputs_event;
/* Whether the model has the variables of sets of fields. */
int cola_has_sets(const struct cola *self);
/* The event LIDoutputstate. */
void cola_send_outputs(struct cola *self, enum cola_form form);
/* The active outputs, a bit each. */
uint32_t cola_outputs(const struct cola *self);
/* Sets the fields as the configuration gives them. */
void cola_fields_load(struct cola *self);
/* Loads the fields likewise, and switches events and outputs off. */
void cola_ports_reset(struct cola *self);
/* Begins the evaluation anew: results are invalid until the next scan. */
void cola_ports_select(struct cola *self);
/* A scan is done: evaluates the fields. */
unsigned cola_ports_scan(struct cola *self);
/* Sends what changed, to a client that asked for it. */
void cola_ports_report(struct cola *self, unsigned news);
/* Time has passed: inputs may have changed. */
void cola_ports_time(struct cola *self);

/* cola_time.c: the clock, and the time server that sets it. */

/* Time of day of the scanner's clock at a device time, ns since 1970. */
int64_t cola_clock_ns(const struct cola *self, int64_t t_ns);
/* Writes that time as telegrams have it: u16 year, 5 x u8 month to second, u32 us. */
void cola_put_time(const struct cola *self, int64_t t_ns, struct cola_out *out);
cola_handler cola_set_clock, cola_read_time_role, cola_write_time_role, cola_read_time_interface,
    cola_write_time_interface, cola_read_time_address, cola_write_time_address, cola_read_time_zone,
    cola_write_time_zone, cola_read_time_update, cola_write_time_update, cola_read_time_limit, cola_read_time_delay;

/* cola_device.c: identity, states and log-in. */

/* Starts the head's scan if it rests. Returns 1 where that is not possible; polls that wait are then refused. */
int cola_start_scan(struct cola *self);
cola_handler cola_read_ident, cola_read_serial, cola_read_firmware, cola_read_location, cola_write_location,
    cola_read_state, cola_read_lms_state, cola_read_hours, cola_read_power_ons, cola_read_contamination, cola_log_in,
    cola_log_out, cola_get_level, cola_check_password, cola_start, cola_stop, cola_load_defaults, cola_reboot;

/* cola_commands.c: one request, and its answer. */

void cola_carry_out(struct cola *self, const struct cola_request *request);
/* Answers sFA with that error. */
void cola_refuse(struct cola *self, enum cola_form form, enum cola_error error);

#endif
