/* Query and change of a setting: its row gives the field, the limits and the unit. */
#include "firmware_sim/command/command_inside.h"

#include <stdio.h>
#include <string.h>

enum { NUMBER_LEN = 32 };

static int64_t read_field(const void *base, size_t offset, int is_u32)
{
    uint32_t narrow;
    int64_t wide;
    if (is_u32) {
        memcpy(&narrow, (const char *)base + offset, sizeof narrow);
        return narrow;
    }
    memcpy(&wide, (const char *)base + offset, sizeof wide);
    return wide;
}

static void write_field(void *base, size_t offset, int is_u32, int64_t value)
{
    const uint32_t narrow = (uint32_t)value; /* the range was checked before */
    if (is_u32)
        memcpy((char *)base + offset, &narrow, sizeof narrow);
    else
        memcpy((char *)base + offset, &value, sizeof value);
}

static int64_t read_bound(const struct command_call *call, const struct command_bound *bound)
{
    if (!bound->of_profile) return bound->value;
    return read_field(&call->dev->limits, (size_t)bound->value, call->row->setting->is_u32);
}

static int64_t read_other(const struct command_call *call)
{
    return read_field(&call->dev->settings, call->row->setting->other_offset, call->row->setting->is_u32);
}

/* A value in the unit of the row. */
struct number {
    char text[NUMBER_LEN];
};
static struct number in_unit(const struct command_call *call, int64_t value)
{
    struct number number;
    command_format_fixed(number.text, sizeof number.text, value, call->row->unit->decimals);
    return number;
}

/* The rates of a head that has only some, of a setting that is one of them; 0: any value in the range. */
static uint32_t fixed_rates(const struct command_call *call, const int64_t **rate)
{
    *rate = call->dev->limits.rate_uhz;
    return call->row->setting->is_rate ? call->dev->limits.n_rates : 0;
}

/* The ends of a range move inward to rates that the head has. The other setting leaves one at least. */
static void narrow_to_rates(const struct command_call *call, int64_t *min, int64_t *max)
{
    const int64_t *rate;
    const uint32_t n = fixed_rates(call, &rate);
    const int64_t from = *min, to = *max;
    for (uint32_t i = n; i-- > 0;)
        if (rate[i] >= from) *min = rate[i];
    for (uint32_t i = 0; i < n; i++)
        if (rate[i] <= to) *max = rate[i];
}

static int is_setting(const struct command_call *call, size_t offset)
{
    return call->row->setting->offset == offset;
}

/* The pulse rate of a head whose lines have a fixed number of pulses. */
static int64_t rate_of_lines(const struct command_call *call)
{
    return call->dev->settings.lines_uhz * call->dev->limits.line_pulses;
}

/* The range now: that of the profile, narrowed by the other setting. */
static void current_range(const struct command_call *call, int64_t *min, int64_t *max)
{
    const struct command_setting *setting = call->row->setting;
    *min = read_bound(call, &setting->min);
    *max = read_bound(call, &setting->max);
    if (setting->other == NULL) return;
    if (call->dev->limits.line_pulses != 0 && is_setting(call, offsetof(struct head_settings, prr_uhz))) {
        *min = *max = rate_of_lines(call);
        return;
    }
    if (call->dev->limits.line_pulses != 0 && is_setting(call, offsetof(struct head_settings, lines_uhz))) return;
    const int64_t other = read_other(call);
    if (setting->least != COMMAND_UNBOUND && other + setting->least > *min) *min = other + setting->least;
    if (setting->most != COMMAND_UNBOUND && other + setting->most < *max) *max = other + setting->most;
    narrow_to_rates(call, min, max);
}

static int64_t special_value(const struct command_call *call)
{
    int64_t min, max;
    current_range(call, &min, &max);
    if (call->value.kind == COMMAND_VALUE_MIN) return min;
    if (call->value.kind == COMMAND_VALUE_MAX) return max;
    return read_field(&call->dev->defaults, call->row->setting->offset, call->row->setting->is_u32);
}

int command_setting_query(struct command_call *call)
{
    const struct command_setting *setting = call->row->setting;
    const int64_t value = call->value.kind == COMMAND_VALUE_NUMBER
                              ? read_field(&call->dev->settings, setting->offset, setting->is_u32)
                              : special_value(call);
    if (setting->words != NULL) return command_reply(call, "%s", setting->words[value]);
    return command_reply(call, "%s", in_unit(call, value).text);
}

/* `HEADER VALUE, allowed MIN to MAX`, or `allowed MAX` where there is one value; value is what the command said, or
 * its number with the unit. */
static int refuse(struct command_call *call, int number, const char *value, int64_t min, int64_t max, const char *with)
{
    if (min == max)
        return command_fail(call, number, "%s %s, allowed %s%s", call->row->header, value, in_unit(call, max).text,
                            with);
    return command_fail(call, number, "%s %s, allowed %s to %s%s", call->row->header, value, in_unit(call, min).text,
                        in_unit(call, max).text, with);
}

static int refuse_number(struct command_call *call, int number, int64_t value, int64_t min, int64_t max,
                         const char *with)
{
    const struct command_unit *unit = call->row->unit;
    char text[NUMBER_LEN + 8];
    snprintf(text, sizeof text, "%s%s%s", in_unit(call, value).text, unit->name[0] != '\0' ? " " : "", unit->name);
    return refuse(call, number, text, min, max, with);
}

static int refuse_fraction(struct command_call *call, const char *value)
{
    const struct command_unit *unit = call->row->unit;
    if (unit->decimals == 0)
        return command_fail(call, CMD_E_RANGE, "%s %s, allowed whole numbers%s%s", call->row->header, value,
                            unit->name[0] != '\0' ? " of " : "", unit->name);
    return command_fail(call, CMD_E_RANGE, "%s %s, allowed multiples of %s %s", call->row->header, value,
                        in_unit(call, 1).text, unit->name);
}

int command_value_in_range(struct command_call *call, int64_t min, int64_t max, int64_t *value)
{
    char clip[COMMAND_CLIP_LEN];
    command_clip(clip, call->param, strlen(call->param));
    const enum command_fit fit =
        command_decimal_to_int(&call->value.decimal, call->value.shift + call->row->unit->decimals, value);
    if (fit == COMMAND_FIT_EXACT && *value >= min && *value <= max) return 0;
    if (fit == COMMAND_FIT_FINE) return refuse_fraction(call, clip);
    if (fit == COMMAND_FIT_BIG) return refuse(call, CMD_E_RANGE, clip, min, max, "");
    return refuse_number(call, CMD_E_RANGE, *value, min, max, "");
}

/* `HEADER VALUE, allowed A, B, C`: a number that is none of the head's rates. */
static int check_rate(struct command_call *call)
{
    const int64_t *rate;
    const uint32_t n = fixed_rates(call, &rate);
    char clip[COMMAND_CLIP_LEN], allowed[HEAD_MAX_RATES * (NUMBER_LEN + 2)] = "";
    int64_t value;
    if (n == 0) return 0;
    const enum command_fit fit =
        command_decimal_to_int(&call->value.decimal, call->value.shift + call->row->unit->decimals, &value);
    for (uint32_t i = 0; i < n; i++) {
        const size_t used = strlen(allowed);
        if (fit == COMMAND_FIT_EXACT && value == rate[i]) return 0;
        snprintf(allowed + used, sizeof allowed - used, "%s%s", i > 0 ? ", " : "", in_unit(call, rate[i]).text);
    }
    command_clip(clip, call->param, strlen(call->param));
    return command_fail(call, CMD_E_RANGE, "%s %s, allowed %s %s", call->row->header, clip, allowed,
                        call->row->unit->name);
}

/* Checks against the other setting; the range of the profile was checked before. */
static int check_other(struct command_call *call, int64_t value)
{
    int64_t min, max;
    current_range(call, &min, &max);
    if (value >= min && value <= max) return 0;
    const char *other = call->row->setting->other;
    char with[NUMBER_LEN + 24] = "";
    if (other != NULL) snprintf(with, sizeof with, " as %s is %s", other, in_unit(call, read_other(call)).text);
    return refuse_number(call, CMD_E_SETTINGS, value, min, max, with);
}

int command_setting_change(struct command_call *call)
{
    const struct command_setting *setting = call->row->setting;
    int64_t value;
    if (call->value.kind == COMMAND_VALUE_WORD)
        value = call->value.word;
    else if (call->value.kind != COMMAND_VALUE_NUMBER)
        value = special_value(call);
    else if (check_rate(call) != 0 || command_value_in_range(call, read_bound(call, &setting->min),
                                                             read_bound(call, &setting->max), &value) != 0)
        return -1;
    if (check_other(call, value) != 0) return -1;
    const enum head_state state = call->dev->state;
    const int in_scan = state == HEAD_SPIN_UP || state == HEAD_SCANNING;
    if (setting->not_in_scan && in_scan && value != read_field(&call->dev->settings, setting->offset, setting->is_u32))
        return command_fail(call, CMD_E_SETTINGS, "%s can't change in state %s", call->row->header,
                            head_state_name(state));
    write_field(&call->dev->settings, setting->offset, setting->is_u32, value);
    if (call->dev->limits.line_pulses != 0) call->dev->settings.prr_uhz = rate_of_lines(call);
    call->out->effect = COMMAND_SETTINGS;
    return command_reply(call, "OK");
}
