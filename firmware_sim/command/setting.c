/* SPDX-License-Identifier: MIT */
/* Query and change of a setting: its row gives the field, the limits and the unit. */
#include "firmware_sim/command/call.h"
#include "firmware_sim/command/command.h"
#include "firmware_sim/command/decimal.h"
#include "firmware_sim/command/error_queue.h"
#include "firmware_sim/command/parse.h"
#include "firmware_sim/command/row.h"
#include "firmware_sim/command/setting.h"
#include "firmware_sim/command/step.h"

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

static int is_setting(const struct command_call *call, size_t offset)
{
    return call->row->setting->offset == offset;
}

/* Inserts a value once into a list that rises. Returns the new length. */
static uint32_t insert(int64_t *value, uint32_t n, int64_t another)
{
    uint32_t i = n;
    for (uint32_t k = 0; k < n; k++)
        if (value[k] == another) return n;
    for (; i > 0 && value[i - 1] > another; i--)
        value[i] = value[i - 1];
    value[i] = another;
    return n + 1;
}

/* Lists the line rates at the present step, or the steps at the present line rate. */
static uint32_t fixed_geometries(const struct command_call *call, int64_t *value)
{
    const struct head_limits *l = &call->dev->limits;
    const struct head_settings *s = &call->dev->settings;
    const int lines =
        call->row->setting->derived == NULL && is_setting(call, offsetof(struct head_settings, lines_uhz));
    const int step = call->row->setting->derived == &command_step_both;
    uint32_t n = 0;
    for (uint32_t i = 0; i < l->n_geometries; i++) {
        if (lines && l->geometry[i].steps == head_line_pulses(l, s)) n = insert(value, n, l->geometry[i].lines_uhz);
        if (step && l->geometry[i].lines_uhz == s->lines_uhz)
            n = insert(value, n, command_step_ndeg(l->geometry[i].steps));
    }
    return n;
}

uint32_t command_setting_values(const struct command_call *call, int64_t value[HEAD_MAX_RATES])
{
    const struct head_limits *l = &call->dev->limits;
    if (!call->row->setting->is_rate) return fixed_geometries(call, value);
    memcpy(value, l->rate_uhz, sizeof l->rate_uhz);
    return l->n_rates;
}

/* Moves the ends of a range inward to rates that the head has. The range, which another setting may have narrowed,
 * always has at least one of these rates. */
static void narrow_to_rates(const struct command_call *call, int64_t *min, int64_t *max)
{
    int64_t rate[HEAD_MAX_RATES];
    const uint32_t n = command_setting_values(call, rate);
    const int64_t from = *min, to = *max;
    for (uint32_t i = n; i-- > 0;)
        if (rate[i] >= from) *min = rate[i];
    for (uint32_t i = 0; i < n; i++)
        if (rate[i] <= to) *max = rate[i];
}

/* Returns the pulse rate of a head whose lines have a fixed number of pulses. */
static int64_t rate_of_lines(const struct command_call *call)
{
    return call->dev->settings.lines_uhz * head_line_pulses(&call->dev->limits, &call->dev->settings);
}

/* Moves the ends of a range inward, since MIN and MAX must be stations of this head. */
static void narrow_to_stations(const struct command_call *call, int64_t *min, int64_t *max)
{
    while (*min < *max && head_is_elsewhere(&call->dev->limits, *min))
        ++*min;
    while (*min < *max && head_is_elsewhere(&call->dev->limits, *max))
        --*max;
}

static int is_line_angle(const struct command_call *call)
{
    return is_setting(call, offsetof(struct head_settings, line_start_udeg)) ||
           is_setting(call, offsetof(struct head_settings, line_stop_udeg));
}

uint32_t command_setting_last_word(const struct command_call *call)
{
    return (uint32_t)read_bound(call, &call->row->setting->max);
}

static int is_sphere(const struct command_call *call)
{
    return call->dev->limits.emitter == EMITTER_SPHERE;
}

/* Returns the most lines of a sphere: with more pulses a line, the largest pulse rate allows fewer lines. */
static int64_t most_lines_of_sphere(const struct command_call *call)
{
    return call->dev->limits.prr_max_uhz / head_line_pulses(&call->dev->limits, &call->dev->settings);
}

/* Finds the present range, as the profile and other settings leave it. */
static void present_range(const struct command_call *call, int64_t *min, int64_t *max)
{
    const struct command_setting *setting = call->row->setting;
    if (setting->derived != NULL) {
        setting->derived->range(call->dev, min, max);
        narrow_to_rates(call, min, max);
        return;
    }
    *min = read_bound(call, &setting->min);
    *max = read_bound(call, &setting->max);
    if (is_setting(call, offsetof(struct head_settings, station))) narrow_to_stations(call, min, max);
    if (setting->other == NULL) return;
    if (call->dev->limits.line_pulses != 0 && is_setting(call, offsetof(struct head_settings, prr_uhz))) {
        *min = *max = rate_of_lines(call);
        return;
    }
    if (call->dev->limits.line_pulses != 0 && is_setting(call, offsetof(struct head_settings, lines_uhz))) {
        if (is_sphere(call) && most_lines_of_sphere(call) < *max) *max = most_lines_of_sphere(call);
        narrow_to_rates(call, min, max);
        return;
    }
    if (call->dev->limits.round && is_line_angle(call)) return;
    const int64_t other = read_other(call);
    if (setting->least != COMMAND_UNBOUND && other + setting->least > *min) *min = other + setting->least;
    if (setting->most != COMMAND_UNBOUND && other + setting->most < *max) *max = other + setting->most;
    narrow_to_rates(call, min, max);
}

static int64_t read_value(const struct command_call *call, const struct head_settings *settings)
{
    const struct command_setting *setting = call->row->setting;
    if (setting->derived != NULL) return setting->derived->read(call->dev, settings);
    return read_field(settings, setting->offset, setting->is_u32);
}

static int64_t special_value(const struct command_call *call)
{
    int64_t min, max;
    present_range(call, &min, &max);
    if (call->value.kind == COMMAND_VALUE_MIN) return min;
    if (call->value.kind == COMMAND_VALUE_MAX) return max;
    return read_value(call, &call->dev->defaults);
}

/* Fails with -221 where the head has no such setting. */
static int check_has(struct command_call *call)
{
    const struct command_derived *derived = call->row->setting->derived;
    const char *why = derived != NULL ? derived->why_not(call->dev) : NULL;
    return why == NULL ? 0 : command_fail(call, CMD_E_SETTINGS, "%s: %s", call->row->header, why);
}

int command_setting_is_known(const struct command_call *call)
{
    const struct command_setting *setting = call->row->setting;
    const int64_t unknown = setting->is_u32 ? (int64_t)COMMAND_NOT_RECORDED_U32 : COMMAND_NOT_RECORDED;
    return call->dev->recorded == NULL || setting->derived != NULL || read_value(call, &call->dev->settings) != unknown;
}

/* Fails with -221 where a recording is replayed that does not have the setting. */
static int check_known(struct command_call *call)
{
    if (command_setting_is_known(call)) return 0;
    return command_fail(call, CMD_E_SETTINGS, "%s: the recording does not have this value", call->row->header);
}

int command_setting_query(struct command_call *call)
{
    const struct command_setting *setting = call->row->setting;
    if (check_has(call) != 0 || check_known(call) != 0) return -1;
    const int64_t value =
        call->value.kind == COMMAND_VALUE_NUMBER ? read_value(call, &call->dev->settings) : special_value(call);
    if (setting->words != NULL) return command_reply(call, "%s", setting->words[value]);
    return command_reply(call, "%s", in_unit(call, value).text);
}

/* Refuses with `HEADER VALUE, allowed MIN to MAX`, or `allowed MAX` where there is one value. value: the command's
 * text, or its number with the unit. */
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

static void say_because(const struct command_call *call, int no_width, char *text, size_t len);

/* Refuses a number, or the value of power-up, that is none of the head's values: `HEADER VALUE, allowed A, B, C`. */
static int check_rate(struct command_call *call)
{
    int64_t rate[HEAD_MAX_RATES], value = 0;
    const uint32_t n = command_setting_values(call, rate);
    char clip[COMMAND_CLIP_LEN], allowed[HEAD_MAX_RATES * (NUMBER_LEN + 2)] = "", with[NUMBER_LEN + 40] = "";
    if (n == 0) return 0;
    enum command_fit fit = COMMAND_FIT_EXACT;
    if (call->value.kind == COMMAND_VALUE_NUMBER)
        fit = command_decimal_to_int(&call->value.decimal, call->value.shift + call->row->unit->decimals, &value);
    else
        value = special_value(call);
    for (uint32_t i = 0; i < n; i++) {
        const size_t used = strlen(allowed);
        if (fit == COMMAND_FIT_EXACT && value == rate[i]) return 0;
        snprintf(allowed + used, sizeof allowed - used, "%s%s", i > 0 ? ", " : "", in_unit(call, rate[i]).text);
    }
    command_clip(clip, call->param, strlen(call->param));
    if (call->dev->limits.n_geometries > 0) say_because(call, 0, with, sizeof with);
    return command_fail(call, CMD_E_RANGE, "%s %s, allowed %s %s%s", call->row->header, clip, allowed,
                        call->row->unit->name, with);
}

/* Writes the reason for the range, as the end of an error. */
static void say_because(const struct command_call *call, int no_width, char *text, size_t len)
{
    const struct command_setting *setting = call->row->setting;
    const char *other = setting->other;
    text[0] = '\0';
    if (setting->derived != NULL)
        setting->derived->because(call->dev, text, len);
    else if ((is_sphere(call) || call->dev->limits.n_geometries > 0) &&
             is_setting(call, offsetof(struct head_settings, lines_uhz)))
        snprintf(text, len, " with this SCAN:STEP");
    else if (other != NULL)
        snprintf(text, len, "%s as %s is %s", no_width ? " but this," : "", other,
                 in_unit(call, read_other(call)).text);
}

static const char *what_word_needs(const struct command_call *call)
{
    if (is_setting(call, offsetof(struct head_settings, noise)))
        return call->dev->limits.noise_most == 0 ? "waveform.echoes: model" : "signal.model: on";
    if (is_setting(call, offsetof(struct head_settings, phase_lock))) return "a head profile with emitter: beams";
    if (is_setting(call, offsetof(struct head_settings, waves))) return "waveform.send: on in the configuration";
    return "mirror_sigma_deg or pan_sigma_deg of the head profile";
}

/* Checks against the other setting; the range of the profile was checked before. */
static int check_other(struct command_call *call, int64_t value)
{
    int64_t min, max;
    char with[NUMBER_LEN + 40];
    present_range(call, &min, &max);
    const int no_width = call->dev->limits.round && is_line_angle(call) && value == read_other(call);
    if (value >= min && value <= max && !no_width) return 0;
    if (call->row->setting->words != NULL)
        return command_fail(call, CMD_E_SETTINGS, "%s %s needs %s", call->row->header, call->row->setting->words[value],
                            what_word_needs(call));
    say_because(call, no_width, with, sizeof with);
    return refuse_number(call, CMD_E_SETTINGS, value, min, max, with);
}

int command_setting_is_free(const struct command_device *dev, const struct command_setting *setting,
                            enum head_state state)
{
    const int in_scan = state == HEAD_SPIN_UP || state == HEAD_SCANNING;
    const int can_vary = dev->limits.emitter == EMITTER_SPHERE || dev->limits.n_geometries > 0;
    return !in_scan || (!setting->not_in_scan && (setting->derived == NULL || !can_vary));
}

/* Whether a step outside MIN to MAX is the step that DEF sets. At the rates of power-up the step in the line and the
 * step of the pan may differ. DEF answers the coarser step, which may be above MAX. A client that sends this step as a
 * number gets what DEF gives. */
static int is_default_beyond(const struct command_call *call, int64_t value)
{
    struct head_settings then = call->dev->defaults;
    int64_t min, max;
    if (call->row->setting->derived == NULL) return 0;
    then.prr_uhz = call->dev->settings.prr_uhz; /* the pulse rate stays */
    present_range(call, &min, &max);
    return (value < min || value > max) && value == read_value(call, &then);
}

static int take_value(struct command_call *call, int64_t *value)
{
    const struct command_setting *setting = call->row->setting;
    if (call->value.kind == COMMAND_VALUE_WORD)
        *value = call->value.word;
    else if (check_rate(call) != 0)
        return -1;
    else if (call->value.kind != COMMAND_VALUE_NUMBER)
        *value = special_value(call);
    else if (command_value_in_range(call, read_bound(call, &setting->min), read_bound(call, &setting->max), value) != 0)
        return -1;
    else if (is_default_beyond(call, *value))
        call->value.kind = COMMAND_VALUE_DEF;
    return 0;
}

static int check_value(struct command_call *call, int64_t value)
{
    const struct command_setting *setting = call->row->setting;
    const enum head_state state = call->dev->state;
    if (is_setting(call, offsetof(struct head_settings, station)) && head_is_elsewhere(&call->dev->limits, value))
        return command_fail(call, CMD_E_SETTINGS, "%s %lld has another scanner; run that: --set head.station=%lld",
                            call->row->header, (long long)value, (long long)value);
    /* DEF of a step brings back the rates of power-up. These rates are allowed together, even where the step that is
     * computed from them is outside its present range (is_default_beyond). */
    const int as_before = setting->derived != NULL && call->value.kind == COMMAND_VALUE_DEF;
    const enum emitter_kind head = call->dev->limits.emitter;
    const int sets = head == EMITTER_LINE || (head == EMITTER_SPHERE && setting->derived == &command_step_both);
    if (!(as_before && sets) && check_other(call, value) != 0) return -1;
    if (!command_setting_is_free(call->dev, setting, state) && value != read_value(call, &call->dev->settings))
        return command_fail(call, CMD_E_SETTINGS, "%s can't change in state %s", call->row->header,
                            head_state_name(state));
    return 0;
}

/* Writes the value into the settings, and sets those that follow from it. */
static int write_value(struct command_call *call, int64_t value)
{
    const struct command_setting *setting = call->row->setting;
    struct command_device *dev = call->dev;
    if (setting->derived == NULL)
        write_field(&dev->settings, setting->offset, setting->is_u32, value);
    else if (setting->derived->write(call, value) != 0)
        return -1;
    if (dev->limits.line_pulses != 0) dev->settings.prr_uhz = rate_of_lines(call);
    return 0;
}

/* While a recording is replayed, a setting may only be set to the value that it has. */
static int keep_recorded(struct command_call *call)
{
    struct command_device *dev = call->dev;
    if (check_known(call) != 0) return -1;
    const int64_t is = read_value(call, &dev->settings);
    int64_t wanted = is;
    int exact = 1;
    if (call->value.kind == COMMAND_VALUE_WORD)
        wanted = call->value.word;
    else if (call->value.kind != COMMAND_VALUE_NUMBER)
        wanted = special_value(call);
    else
        exact = command_decimal_to_int(&call->value.decimal, call->value.shift + call->row->unit->decimals, &wanted) ==
                COMMAND_FIT_EXACT;
    if (exact && wanted == is) return command_reply(call, "OK");
    return command_fail(call, CMD_E_SETTINGS, "%s: %s; it is %s", call->row->header, dev->recorded,
                        call->row->setting->words != NULL ? call->row->setting->words[is] : in_unit(call, is).text);
}

int command_setting_change(struct command_call *call)
{
    struct command_device *dev = call->dev;
    if (dev->recorded != NULL) return check_has(call) != 0 ? -1 : keep_recorded(call);
    const struct head_settings before = dev->settings;
    char why[COMMAND_TEXT_LEN];
    int64_t value;
    if (check_has(call) != 0 || take_value(call, &value) != 0 || check_value(call, value) != 0) return -1;
    if (write_value(call, value) != 0) return -1;
    if (dev->can_plan != NULL && dev->can_plan(dev->owner, &dev->settings, why, sizeof why) != 0) {
        dev->settings = before;
        return command_fail(call, CMD_E_SETTINGS, "%s: %s", call->row->header, why);
    }
    call->out->effect = COMMAND_SETTINGS;
    call->out->for_next_scan = !command_setting_is_free(dev, call->row->setting, HEAD_SCANNING) &&
                               read_value(call, &before) != read_value(call, &dev->settings);
    if (call->row->setting->derived != NULL)
        return command_reply(call, "%s", in_unit(call, read_value(call, &dev->settings)).text);
    return command_reply(call, "OK");
}
