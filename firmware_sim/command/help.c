/* SPDX-License-Identifier: MIT */
/* HELP? and HELP:SETtings?: the table of commands, for people and for programs. */
#include "firmware_sim/command/call.h"
#include "firmware_sim/command/command.h"
#include "firmware_sim/command/help.h"
#include "firmware_sim/command/parse.h"
#include "firmware_sim/command/row.h"
#include "firmware_sim/command/setting.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static void __attribute__((format(printf, 2, 3))) add(struct command_call *call, const char *fmt, ...)
{
    char *reply = call->out->reply;
    const size_t len = strlen(reply);
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(reply + len, sizeof call->out->reply - len, fmt, ap);
    va_end(ap);
}

static void add_word(struct command_call *call, const char *word, const char *end)
{
    add(call, "%s%s%s", call->out->reply[0] == '\0' ? "" : " ", word, end);
}

/* Lists the commands that are not settings. One reply has no room for these and the settings. */
static int list_others(struct command_call *call)
{
    for (const struct command_row *row = command_rows; row->header != NULL; row++)
        if (row->setting == NULL) add_word(call, row->header, row->act == NULL ? "?" : "");
    return 0;
}

int command_help_settings(struct command_call *call)
{
    for (const struct command_row *row = command_rows; row->header != NULL; row++)
        if (row->setting != NULL) add_word(call, row->header, "");
    return 0;
}

/* Adds the states in which the row's command can be set or carried out: "all", or some with blanks between them. */
static void add_states(struct command_call *call)
{
    const struct command_row *row = call->row;
    char list[128] = "";
    int n = 0;
    for (int i = 0; i < HEAD_N_STATES; i++) {
        const enum head_state state = (enum head_state)i;
        const int free = row->setting != NULL ? command_setting_is_free(call->dev, row->setting, state)
                         : row->event != 0    ? head_next_state(state, (enum head_event)(row->event - 1)) >= 0
                                              : 1;
        const size_t len = strlen(list);
        if (free) snprintf(list + len, sizeof list - len, "%s%s", n++ == 0 ? "" : " ", head_state_name(state));
    }
    add(call, "\"%s\"", n == HEAD_N_STATES ? "all" : list);
}

/* Adds min,max,default,step. Each may be empty. */
static void add_numbers(struct command_call *call)
{
    const int decimals = call->row->unit->decimals;
    const struct command_setting *setting = call->row->setting;
    const int known = command_setting_is_known(call); /* a query of an unknown one queues an error */
    struct command_call ask = *call;
    struct command_result answer;
    char number[32];
    ask.out = &answer;
    for (int kind = COMMAND_VALUE_MIN; kind <= COMMAND_VALUE_DEF; kind++) {
        ask.value.kind = (enum command_value_kind)kind;
        if (known && (setting->words == NULL || kind == COMMAND_VALUE_DEF) && command_setting_query(&ask) == 0)
            add(call, "%s", answer.reply);
        add(call, ",");
    }
    command_format_fixed(number, sizeof number, 1, decimals);
    add(call, "%s,", setting->words == NULL ? number : "");
}

/* Adds the words or numbers of a setting that takes only some; otherwise an empty text. */
static void add_values(struct command_call *call)
{
    const struct command_setting *setting = call->row->setting;
    int64_t value[HEAD_MAX_RATES];
    const uint32_t n = setting->words == NULL ? command_setting_values(call, value) : 0;
    char number[32];
    add(call, ",\"");
    for (uint32_t i = 0; setting->words != NULL && i <= command_setting_last_word(call); i++)
        add(call, "%s%s", i == 0 ? "" : " ", setting->words[i]);
    for (uint32_t i = 0; i < n; i++) {
        command_format_fixed(number, sizeof number, value[i], call->row->unit->decimals);
        add(call, "%s%s", i == 0 ? "" : " ", number);
    }
    add(call, "\"");
}

/* 0: the head has no such setting, so there are no limits and no states to list. */
static int has_setting(const struct command_call *call)
{
    const struct command_derived *derived = call->row->setting->derived;
    return derived == NULL || derived->why_not(call->dev) == NULL;
}

static int help_describe(struct command_call *call)
{
    const struct command_row *row = call->row;
    const struct command_setting *setting = row->setting;
    if (setting == NULL) {
        const char *kind = row->act == NULL ? "query" : row->query == NULL ? "action" : "setting";
        add(call, "%s,\"%s\",,,,,", kind, row->unit != NULL ? row->unit->name : "");
        add_states(call);
        add(call, ",\"\"");
        return 0;
    }
    const char *kind = setting->words != NULL ? "word" : "number";
    if (!has_setting(call)) {
        add(call, "%s,\"%s\",,,,,\"\",\"\"", kind, row->unit->name);
        return 0;
    }
    add(call, "%s,\"%s\",", kind, row->unit->name);
    add_numbers(call);
    add_states(call);
    add_values(call);
    return 0;
}

int command_help(struct command_call *call)
{
    const char *header = call->param + (call->param[0] == ':');
    size_t len = strlen(header);
    len -= len > 0 && header[len - 1] == '?'; /* HELP? itself lists headers with '?' */
    if (len == 0) return list_others(call);
    const struct command_row *row = command_find_row(header, len);
    if (row != NULL) {
        call->row = row;
        return help_describe(call);
    }
    char clip[COMMAND_CLIP_LEN];
    command_clip(clip, call->param, strlen(call->param));
    return command_fail(call, CMD_E_DATA_TYPE, "HELP? takes a header, not '%s'; HELP? and HELP:SETtings? list them",
                        clip);
}
