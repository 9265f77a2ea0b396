/* SPDX-License-Identifier: MIT */
/* Identity, states and log-in. */
#include <stdio.h>
#include <string.h>

#include "drivers/protocol/cola.h"
#include "drivers/protocol/cola_clock.h"

enum { MOST_LOCATION = 16 };

/* ---- identity */

static const char *version(const struct cola *self)
{
    return self->spec.identity->firmware[0] != 0 ? self->spec.identity->firmware : self->model->version;
}

enum cola_error cola_read_ident(struct cola *self)
{
    cola_put_text(&self->out, self->spec.identity->model);
    cola_put_text(&self->out, version(self));
    return COLA_OK;
}

enum cola_error cola_read_serial(struct cola *self)
{
    cola_put_text(&self->out, self->spec.identity->serial);
    return COLA_OK;
}

enum cola_error cola_read_firmware(struct cola *self)
{
    const char *const v = version(self);
    cola_put_text(&self->out, strcmp(v, self->model->version) == 0 ? self->model->firmware : v);
    return COLA_OK;
}

enum cola_error cola_read_location(struct cola *self)
{
    cola_put_text(&self->out, self->set.location);
    return COLA_OK;
}

enum cola_error cola_write_location(struct cola *self)
{
    char name[MOST_LOCATION + 1];
    cola_arg_text(&self->args, name, sizeof name);
    const enum cola_error error = cola_args_end(&self->args);
    if (error != COLA_OK) return error;
    for (const char *c = name; *c != '\0'; c++)
        if (*c < 0x20 || *c > 0x7e) return COLA_INVALID_DATA; /* mEEwriteall writes it as a line of the settings file */
    memcpy(self->set.location, name, sizeof name);
    return COLA_OK;
}

/* ---- states */

enum cola_error cola_read_state(struct cola *self)
{
    enum { BUSY, READY, ERROR };
    const enum protocol_head_state head = protocol_ask_state(&self->spec.host);
    if (head == PROTOCOL_HEAD_FAULT)
        cola_put_u(&self->out, 1, ERROR);
    else
        cola_put_u(&self->out, 1, head <= PROTOCOL_HEAD_BOOT || !self->scan.head.known ? BUSY : READY);
    return COLA_OK;
}

/* u16 state, u8 temperature, text time, text date, 3 x u16 LED */
enum cola_error cola_read_lms_state(struct cola *self)
{
    enum { UNDEFINED, INITIALISATION, CONFIGURATION, REST, ROTATES, PREPARATION, READY, MEASURES };
    static const uint8_t states[] = {INITIALISATION, INITIALISATION, REST, PREPARATION, MEASURES, ROTATES, UNDEFINED};
    const struct cola_date d = cola_date_of(cola_clock_ns(self, self->now_ns));
    const enum protocol_head_state head = protocol_ask_state(&self->spec.host);
    uint32_t state = head == PROTOCOL_HEAD_UNKNOWN ? (uint32_t)UNDEFINED : states[head];
    char text[40];
    if (state == MEASURES && !self->measures) state = READY;
    cola_put_u(&self->out, 2, state);
    cola_put_u(&self->out, 1, 0);
    snprintf(text, sizeof text, "%02u:%02u:%02u", d.hour, d.minute, d.second);
    cola_put_text(&self->out, text);
    snprintf(text, sizeof text, "%02u.%02u.%04u", d.day, d.month, d.year);
    cola_put_text(&self->out, text);
    for (int i = 0; i < 3; i++)
        cola_put_u(&self->out, 2, 0);
    return COLA_OK;
}

/* u8 0 none, 1 warning, 2 error, 3 serious error */
enum cola_error cola_read_contamination(struct cola *self)
{
    static const double levels_db[] = {1.0, 3.0, 10.0};
    const double loss_db =
        self->spec.host.window_loss_db != NULL ? self->spec.host.window_loss_db(self->spec.host.ctx) : 0.0;
    uint32_t level = 0;
    while (level < 3 && loss_db >= levels_db[level])
        level++;
    cola_put_u(&self->out, 1, level);
    return COLA_OK;
}

enum cola_error cola_read_hours(struct cola *self)
{
    const int64_t tenth_ns = INT64_C(360000000000);
    cola_put_u(&self->out, 4, (uint32_t)((self->now_ns - self->spec.power_ns) / tenth_ns));
    return COLA_OK;
}

enum cola_error cola_read_power_ons(struct cola *self)
{
    cola_put_u(&self->out, 4, self->spec.power_ons);
    return COLA_OK;
}

/* ---- log-in */

static int password_fits(const struct cola *self)
{
    const uint32_t level = self->arg[0], hash = self->arg[1];
    return (level == COLA_MAINTENANCE && hash == 0xb21ace26) || (level == COLA_CLIENT && hash == 0xf4724744) ||
           (level == COLA_SERVICE && hash == 0x81be23aa);
}

/* u8 level, u32 hash of the password; u8 1: done */
enum cola_error cola_log_in(struct cola *self)
{
    if (password_fits(self)) self->level = (enum cola_level)self->arg[0];
    return cola_check_password(self);
}

enum cola_error cola_check_password(struct cola *self)
{
    cola_put_u(&self->out, 1, (uint32_t)password_fits(self));
    return COLA_OK;
}

enum cola_error cola_get_level(struct cola *self)
{
    cola_put_u(&self->out, 1, (uint32_t)self->level);
    return COLA_OK;
}

enum cola_error cola_log_out(struct cola *self)
{
    self->level = COLA_RUN;
    cola_put_u(&self->out, 1, 1);
    return COLA_OK;
}

/* ---- measurement */

int cola_start_scan(struct cola *self)
{
    const enum protocol_head_state head = protocol_ask_state(&self->spec.host);
    /* While the wish lasts, a head that is idle is started again, since somebody may have stopped it. */
    const int starts = head == PROTOCOL_HEAD_IDLE && !scan_wish_is_starting(&self->wish, &self->scan, self->now_ns);
    int refused = head == PROTOCOL_HEAD_FAULT || head == PROTOCOL_HEAD_UNKNOWN;
    if (starts) refused = self->spec.host.command(self->spec.host.ctx, "SCAN:START", NULL, 0) != 0;
    if (!refused && !self->wish.lasts) scan_wish_make(&self->wish, self->now_ns);
    if (!refused && starts) scan_wish_start(&self->wish, self->now_ns);
    if (!refused) return 0;
    self->wish.lasts = 0;
    for (uint32_t i = 0; i < self->n_waiting; i++)
        cola_refuse(self, (enum cola_form)self->waiting_form[i], COLA_CONDITION);
    self->n_waiting = 0;
    return 1;
}

/* u8 0: measures; 1: not allowed; polls that wait are then refused */
enum cola_error cola_start(struct cola *self)
{
    const int refused = cola_start_scan(self);
    if (!refused) self->measures = self->started = 1;
    cola_put_u(&self->out, 1, (uint32_t)refused);
    return COLA_OK;
}

/* Stops the output of this session alone: the head goes on, since others may read it. */
enum cola_error cola_stop(struct cola *self)
{
    self->measures = self->started = 0;
    self->wish.lasts &= self->n_waiting != 0; /* a poll is answered also where nothing is measured */
    cola_ports_select(self);                  /* drops the fields' results: they are out of date from now on */
    cola_put_u(&self->out, 1, 0);
    return COLA_OK;
}

/* ---- defaults and reboot */

enum cola_error cola_load_defaults(struct cola *self)
{
    cola_settings_reset(self);
    cola_fields_load(self);
    return COLA_OK;
}

enum cola_error cola_reboot(struct cola *self)
{
    self->reboots = 1;
    return COLA_OK;
}
