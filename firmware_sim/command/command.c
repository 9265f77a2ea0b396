/* SPDX-License-Identifier: MIT */
/* One line from split to reply: find its row, take its value, check control, let the row act. */
#include "firmware_sim/command/call.h"
#include "firmware_sim/command/command.h"
#include "firmware_sim/command/decimal.h"
#include "firmware_sim/command/error_queue.h"
#include "firmware_sim/command/parse.h"
#include "firmware_sim/command/row.h"
#include "firmware_sim/command/setting.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

int command_reply(struct command_call *call, const char *fmt, ...)
{
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(call->out->reply, sizeof call->out->reply, fmt, ap);
    va_end(ap);
    return 0;
}

int command_accept(struct command_call *call, enum command_effect effect)
{
    call->out->effect = effect;
    return command_reply(call, "OK");
}

int command_fail(struct command_call *call, int number, const char *fmt, ...)
{
    char text[COMMAND_TEXT_LEN], entry[COMMAND_TEXT_LEN];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text, sizeof text, fmt, ap);
    va_end(ap);
    command_queue_push(&call->dev->queue, number, text);
    /* Compose the reply anew: in a full queue the entry is -350, but the reply must still name the error. */
    command_error_compose(entry, sizeof entry, number, text);
    call->out->error = number;
    command_reply(call, "ERR %d,\"%s\"", number, entry);
    return -1;
}

void command_refuse(struct command_device *dev, int number, const char *text, struct command_result *out)
{
    struct command_call call = {.dev = dev, .out = out};
    command_fail(&call, number, "%s", text);
}

const struct command_row *command_find_row(const char *header, size_t len)
{
    for (const struct command_row *row = command_rows; row->header != NULL; row++)
        if (command_header_matches(row->header, header, len)) return row;
    return NULL;
}

int command_parse_special(const char *param, enum command_value_kind *kind)
{
    static const char *const specials[] = {
        [COMMAND_VALUE_MIN] = "MINimum", [COMMAND_VALUE_MAX] = "MAXimum", [COMMAND_VALUE_DEF] = "DEFault"};
    for (int i = COMMAND_VALUE_MIN; i <= COMMAND_VALUE_DEF; i++)
        if (command_word_matches(specials[i], param)) {
            *kind = (enum command_value_kind)i;
            return 1;
        }
    return 0;
}

static int suffix_shift(const struct command_unit *unit, const char *suffix, int *shift)
{
    for (size_t i = 0; i < sizeof unit->suffix / sizeof unit->suffix[0]; i++)
        if (unit->suffix[i].suffix != NULL && strcasecmp(unit->suffix[i].suffix, suffix) == 0) {
            *shift = unit->suffix[i].shift;
            return 1;
        }
    return 0;
}

static int is_letter(char c)
{
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z');
}

/* Parses one of a setting's words, or DEF; returns -1 when it failed. */
static int parse_word(struct command_call *call)
{
    const char *const *words = call->row->setting->words;
    char list[96] = "", clip[COMMAND_CLIP_LEN];
    size_t len = 0;
    if (command_word_matches("DEFault", call->param)) {
        call->value.kind = COMMAND_VALUE_DEF;
        return 0;
    }
    call->value.kind = COMMAND_VALUE_WORD;
    for (call->value.word = 0; words[call->value.word] != NULL; call->value.word++) {
        if (command_word_matches(words[call->value.word], call->param)) return 0;
        len += (size_t)snprintf(list + len, sizeof list - len, "%s, ", words[call->value.word]);
    }
    command_clip(clip, call->param, strlen(call->param));
    return command_fail(call, CMD_E_DATA_TYPE, "%s takes %sDEF, not '%s'", call->row->header, list, clip);
}

/* Parses the one parameter of a setting or a step; returns -1 when it failed. */
static int parse_value(struct command_call *call)
{
    const struct command_row *row = call->row;
    char clip[COMMAND_CLIP_LEN];
    char *comma = strchr(call->param, ',');
    if (comma != NULL && row->pose) {
        call->pose = comma + 1;
        while (comma > call->param && (comma[-1] == ' ' || comma[-1] == '\t'))
            comma--;
        *comma = '\0';
    } else if (comma != NULL) {
        return command_fail(call, CMD_E_NOT_ALLOWED, "%s takes one value", row->header);
    }
    if (row->setting != NULL && row->setting->words != NULL) return parse_word(call);
    if (row->setting != NULL && command_parse_special(call->param, &call->value.kind)) return 0;
    call->value.kind = COMMAND_VALUE_NUMBER;
    command_clip(clip, call->param, strlen(call->param));
    const char *suffix = command_parse_decimal(call->param, &call->value.decimal);
    if (suffix == NULL || (*suffix != '\0' && !is_letter(*suffix)))
        return command_fail(call, CMD_E_DATA_TYPE, "%s takes a number%s, not '%s'", row->header,
                            row->setting != NULL ? ", MIN, MAX or DEF" : "", clip);
    if (*suffix == '\0' || suffix_shift(row->unit, suffix, &call->value.shift)) return 0;
    command_clip(clip, suffix, strlen(suffix));
    return command_fail(call, CMD_E_SUFFIX, "'%s'; %s takes %s", clip, row->header, row->unit->suffixes);
}

static int do_query(struct command_call *call)
{
    const struct command_row *row = call->row;
    if (row->query == NULL) return command_fail(call, CMD_E_HEADER, "%s has no query form", row->header);
    call->value.kind = COMMAND_VALUE_NUMBER;
    if (row->own) return row->query(call);
    if (call->param[0] != '\0' && !row->word &&
        (row->setting == NULL || !command_parse_special(call->param, &call->value.kind)))
        return command_fail(call, CMD_E_NOT_ALLOWED, "%s? takes %s", row->header,
                            row->setting == NULL ? "no parameter" : "no parameter but MIN, MAX or DEF");
    return row->query(call);
}

void command_set_peer(struct command_device *dev, uint32_t session, const char *name)
{
    if (session > 0 && session < COMMAND_PEERS)
        snprintf(dev->peers.name[session], sizeof dev->peers.name[session], "%s", name);
}

const char *command_peer(const struct command_device *dev, uint32_t session)
{
    return session < COMMAND_PEERS ? dev->peers.name[session] : "";
}

static int fail_protected(struct command_call *call)
{
    const uint32_t control = call->dev->control;
    const char *peer = command_peer(call->dev, control);
    if (peer[0] == '\0')
        return command_fail(call, CMD_E_PROTECTED, "session %u has control, this is session %u", control,
                            call->session);
    return command_fail(call, CMD_E_PROTECTED, "%s has control (session %u), this is session %u", peer, control,
                        call->session);
}

static int do_act(struct command_call *call)
{
    const struct command_row *row = call->row;
    const uint32_t control = call->dev->control;
    if (row->act == NULL) return command_fail(call, CMD_E_HEADER, "%s is only a query, %s?", row->header, row->header);
    if (row->unit == NULL && call->param[0] != '\0')
        return command_fail(call, CMD_E_NOT_ALLOWED, "%s takes no parameter", row->header);
    if (row->unit != NULL && call->param[0] == '\0')
        return command_fail(call, CMD_E_MISSING, "%s takes a %s", row->header,
                            row->unit->takes != NULL                              ? row->unit->takes
                            : row->setting != NULL && row->setting->words != NULL ? "word"
                                                                                  : "number");
    if (row->unit != NULL && !row->own && parse_value(call) != 0) return -1;
    if (!row->open && call->session != 0 && control != 0 && control != call->session) return fail_protected(call);
    if (row->act(call) != 0) return -1;
    struct command_result *out = call->out;
    const int takes = out->effect != COMMAND_NONE && out->effect != COMMAND_RELEASE;
    out->changes = takes && out->effect != COMMAND_TAKE;
    if (!takes || call->session == 0 || control != 0) return 0;
    call->dev->control = call->session;
    out->took_control = 1;
    return 0;
}

void command_execute(struct command_device *dev, uint32_t session, const char *line, struct command_result *out)
{
    struct command_request req;
    const char *why = NULL;
    memset(out, 0, sizeof *out);
    struct command_call call = {.dev = dev, .session = session, .out = out};
    const int error = command_split(line, &req, &why);
    if (error != 0) {
        command_fail(&call, error, "%s", why);
        return;
    }
    if (req.header_len == 0) return;
    call.row = command_find_row(req.header, req.header_len);
    call.param = req.param;
    if (call.row == NULL) {
        char clip[COMMAND_CLIP_LEN];
        command_clip(clip, req.header, req.header_len);
        command_fail(&call, CMD_E_HEADER, "'%s'; HELP? and HELP:SETtings? list all", clip);
    } else if (req.query) {
        do_query(&call);
    } else {
        do_act(&call);
    }
}
