/* SPDX-License-Identifier: MIT */
/* Requests of CoLa by name. One table: what exists, who may do it, which function does it. */
#include <stdio.h>
#include <string.h>

#include "drivers/protocol/cola.h"

static cola_handler set_scan_event;

static const struct command {
    const char *name;
    char verb;     /* of s?N: R, W, M, E */
    uint8_t level; /* at least */
    /* The request's values. 1, 2, 4: a number of so many bytes without a sign; h, i: one of 2 or 4 bytes with a sign;
     * s: a switch, u8 0 or 1. Before them ?: not all models have the variable. NULL: carry_out reads them. */
    const char *values;
    cola_handler *carry_out;
} commands[] = {
    {"0", 'R', COLA_RUN, "", cola_read_ident},
    {"DeviceIdent", 'R', COLA_RUN, "", cola_read_ident},
    {"SerialNumber", 'R', COLA_RUN, "", cola_read_serial},
    {"FirmwareVersion", 'R', COLA_RUN, "", cola_read_firmware},
    {"LocationName", 'R', COLA_RUN, "", cola_read_location},
    {"LocationName", 'W', COLA_CLIENT, NULL, cola_write_location},
    {"SCdevicestate", 'R', COLA_RUN, "", cola_read_state},
    {"STlms", 'R', COLA_RUN, "", cola_read_lms_state},
    {"LCMstate", 'R', COLA_RUN, "", cola_read_contamination},
    {"ODoprh", 'R', COLA_RUN, "", cola_read_hours},
    {"ODpwrc", 'R', COLA_RUN, "", cola_read_power_ons},
    {"EIHstCola", 'R', COLA_RUN, "", cola_read_framing},
    {"EIHstCola", 'W', COLA_CLIENT, "1", cola_write_framing},
    {"LMPoutputRange", 'R', COLA_RUN, "", cola_read_output_range},
    {"LMPoutputRange", 'W', COLA_CLIENT, "24ii", cola_write_output_range},
    {"LMPscancfg", 'R', COLA_RUN, "", cola_read_scan_cfg},
    {"LMDscandatacfg", 'R', COLA_RUN, "", cola_read_scan_data_cfg},
    {"LMDscandatacfg", 'W', COLA_CLIENT, "111111111112", cola_write_scan_data_cfg},
    {"LMDscandatascalefactor", 'R', COLA_RUN, "", cola_read_scale},
    {"LMDscandatascalefactor", 'W', COLA_CLIENT, "4", cola_write_scale},
    {"FREchoFilter", 'R', COLA_RUN, "", cola_read_filter},
    {"FREchoFilter", 'W', COLA_CLIENT, "1", cola_write_filter},
    {"LMDscandata", 'R', COLA_RUN, "", cola_read_scan},
    {"LIDinputstate", 'R', COLA_RUN, "", cola_read_inputs},
    {"LIDoutputstate", 'R', COLA_RUN, "", cola_read_outputs},
    {"LFErec", 'R', COLA_RUN, "", cola_read_field_results},
    {"FieldSetSelectionMethod", 'R', COLA_RUN, "?", cola_read_set_method},
    {"FieldSetSelectionMethod", 'W', COLA_CLIENT, "?s", cola_write_set_method},
    {"ActiveFieldSet", 'R', COLA_RUN, "?", cola_read_set},
    {"ActiveFieldSet", 'W', COLA_CLIENT, "?2", cola_write_set},
    {"TSCRole", 'R', COLA_RUN, "", cola_read_time_role},
    {"TSCRole", 'W', COLA_CLIENT, "1", cola_write_time_role},
    {"TSCTCInterface", 'R', COLA_RUN, "", cola_read_time_interface},
    {"TSCTCInterface", 'W', COLA_CLIENT, "1", cola_write_time_interface},
    {"TSCTCSrvAddr", 'R', COLA_RUN, "", cola_read_time_address},
    {"TSCTCSrvAddr", 'W', COLA_CLIENT, "1111", cola_write_time_address},
    {"TSCTCtimezone", 'R', COLA_RUN, "", cola_read_time_zone},
    {"TSCTCtimezone", 'W', COLA_CLIENT, "1", cola_write_time_zone},
    {"TSCTCupdatetime", 'R', COLA_RUN, "", cola_read_time_update},
    {"TSCTCupdatetime", 'W', COLA_CLIENT, "4", cola_write_time_update},
    {"TSCTCmaxoffset", 'R', COLA_RUN, "", cola_read_time_limit},
    {"TSCTCdelay", 'R', COLA_RUN, "", cola_read_time_delay},
    {"SetAccessMode", 'M', COLA_RUN, "14", cola_log_in},
    {"GetAccessMode", 'M', COLA_RUN, "", cola_get_level},
    {"CheckPassword", 'M', COLA_RUN, "14", cola_check_password},
    {"Run", 'M', COLA_RUN, "", cola_log_out},
    {"mLMPsetscancfg", 'M', COLA_CLIENT, "4h4ii", cola_set_scan_cfg},
    {"LMCstartmeas", 'M', COLA_CLIENT, "", cola_start},
    {"LMCstopmeas", 'M', COLA_CLIENT, "", cola_stop},
    {"LMCstandby", 'M', COLA_CLIENT, "", cola_stop},
    {"LSPsetdatetime", 'M', COLA_CLIENT, "2111114", cola_set_clock},
    {"mEEwriteall", 'M', COLA_CLIENT, "", cola_keep},
    {"mSCloadappdef", 'M', COLA_CLIENT, "", cola_load_defaults},
    {"mSCloadfacdef", 'M', COLA_CLIENT, "", cola_load_defaults},
    {"mSCreboot", 'M', COLA_CLIENT, "", cola_reboot},
    {"LMDscandata", 'E', COLA_RUN, "s", set_scan_event},
    {"LIDinputstate", 'E', COLA_RUN, "s", cola_set_inputs_event},
    {"LIDoutputstate", 'E', COLA_RUN, "s", cola_set_outputs_event},
    {"LFErec", 'E', COLA_RUN, "s", cola_set_results_event},
};

/* field000 and on */
static const struct command any_field = {"field", 'R', COLA_RUN, "", cola_read_field},
                            set_field = {"field", 'W', COLA_CLIENT, NULL, cola_write_field};

static enum cola_error set_scan_event(struct cola *self)
{
    self->streams = (int)self->arg[0];
    self->since_sent = self->set.every; /* the next one is sent */
    if (self->streams && self->measures) cola_start_scan(self);
    return COLA_OK;
}

/* Sends an error. The error is made in a buffer of its own: self->unit may hold the unfinished answer to another
 * request. */
void cola_refuse(struct cola *self, enum cola_form form, enum cola_error error)
{
    uint8_t unit[32];
    struct cola_out out = {.buf = unit, .cap = sizeof unit};
    cola_begin(&out, form, "sFA");
    cola_put_u(&out, 2, (uint32_t)error);
    self->spec.host.count(self->spec.host.ctx, PROTOCOL_WRONG, 1);
    self->spec.host.send(self->spec.host.ctx, unit, cola_end(&out));
}

/* A request cut into its parts. */
struct parts {
    char verb; /* of s?N and sRI; 0: none of them */
    char name[COLA_MAX_NAME];
    struct cola_args args;
};

static struct parts cut(const struct cola_request *r)
{
    const uint8_t *at = r->payload, *const end = r->payload + r->len;
    struct parts p = {.args = {.form = r->form}};
    size_t n = 0;
    if (r->len >= 3 && at[0] == 's' && strchr("RWME", at[1]) != NULL && at[1] != 0 && at[2] == 'N')
        p.verb = (char)at[1];
    if (r->len >= 3 && memcmp(at, "sRI", 3) == 0) p.verb = 'R'; /* by number: sRI0, sRI 0 */
    if (p.verb == 0) return p;
    for (at += 3; at < end && *at == ' '; at++)
        ;
    for (; at<end && * at> ' ' && *at <= '~'; at++)
        if (n + 1 < sizeof p.name) p.name[n++] = (char)*at;
    if (at < end && *at == ' ') at++;
    p.args.at = p.verb == 'R' ? end : at; /* clients put a 1 after the name; a read has no values that could be wrong */
    p.args.end = end;
    return p;
}

/* The row; NULL and an error: there is none. */
static const struct command *cola_commands_find(const struct cola *self, const struct parts *p, enum cola_error *error)
{
    const struct command *other = NULL;
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++) {
        if (strcmp(commands[i].name, p->name) != 0) continue;
        if (commands[i].verb == p->verb) return &commands[i];
        other = &commands[i];
    }
    if (p->verb == 'R' && self->field < self->model->n_fields) return &any_field;
    if (p->verb == 'W' && self->field < self->model->n_records) return &set_field;
    const int read_only = other != NULL && other->verb == 'R' && p->verb == 'W';
    *error = p->verb == 'M'   ? COLA_METHOD_UNKNOWN
             : p->verb == 'E' ? COLA_EVENT_UNKNOWN
             : read_only      ? COLA_WRITE_DENIED
                              : COLA_VARIABLE_UNKNOWN;
    return NULL;
}

static const char *answer_verb(char verb)
{
    return verb == 'R' ? "sRA" : verb == 'W' ? "sWA" : verb == 'M' ? "sAN" : "sEA";
}

static enum cola_error read_values(struct cola *self, const char *values)
{
    struct cola_args *const args = &self->args;
    if (values == NULL) return COLA_OK;
    if (*values == '?' && !cola_has_sets(self)) return COLA_VARIABLE_UNKNOWN;
    values += *values == '?';
    for (size_t i = 0; values[i] != '\0'; i++)
        if (values[i] == 'h' || values[i] == 'i')
            self->arg[i] = (uint32_t)cola_arg_i(args, values[i] == 'h' ? 2 : 4);
        else
            self->arg[i] = cola_arg_u(args, values[i] == 's' ? 1 : (unsigned)(values[i] - '0'));
    const enum cola_error error = cola_args_end(args);
    return error == COLA_OK && *values == 's' && self->arg[0] > 1 ? COLA_INVALID_DATA : error;
}

static enum cola_error carry_out(struct cola *self, const struct cola_request *request)
{
    struct parts p = cut(request);
    enum cola_error error = COLA_COMMAND_UNKNOWN;
    self->field = cola_field_number(p.name);
    char head[COLA_MAX_NAME + 4];
    const struct command *c = p.verb != 0 ? cola_commands_find(self, &p, &error) : NULL;
    if (c == NULL) return error;
    if (c->level > self->level) return c->verb == 'W' ? COLA_WRITE_DENIED : COLA_METHOD_DENIED;
    snprintf(head, sizeof head, "%s %s", answer_verb(p.verb), p.name);
    cola_begin(&self->out, request->form, head);
    self->args = p.args;
    error = read_values(self, c->values);
    if (error == COLA_OK && c->verb == 'E') cola_put_u(&self->out, 1, self->arg[0]);
    return error == COLA_OK ? c->carry_out(self) : error;
}

/* The head's power cycle ends all sessions. Where there can't be one, as with a recording, only this session begins
 * anew. */
static void reboot(struct cola *self)
{
    const int refused = self->spec.host.command(self->spec.host.ctx, "HEAD:REBoot", NULL, 0) != 0;
    /* There can be no error: cola_keep wrote what is stored, or the session read it when it began. */
    cola_power_up(self, NULL);
    if (refused) self->spec.host.hang_up(self->spec.host.ctx);
}

void cola_carry_out(struct cola *self, const struct cola_request *request)
{
    const uint16_t telegrams = self->telegrams;
    cola_deliver(self); /* a scan from before the request still has the form from before it */
    cola_look_at_head(self);
    self->stream_form = request->form;
    self->out = (struct cola_out){.buf = self->unit, .cap = sizeof self->unit};
    const enum cola_error error = carry_out(self, request);
    if (error == COLA_LATER) return;
    if (error != COLA_OK)
        cola_refuse(self, request->form, error);
    else if (self->spec.host.send(self->spec.host.ctx, self->unit, cola_end(&self->out)) != 0)
        self->telegrams = telegrams;
    if (self->outputs_due) cola_send_outputs(self, request->form);
    if (self->reboots) reboot(self);
}
