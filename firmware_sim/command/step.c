/* SPDX-License-Identifier: MIT */
/* SCAN:STEP, SCAN:STEP:LINE, SCAN:STEP:PAN: angles from pulse to pulse and from line to line, in nano-degrees. On a
 * line head they follow from its rates. Setting them sets the rates, except the pulse rate:
 *
 *     step in the line  = sweep * lines / pulse rate        the sweep with its blind part
 *     step of the pan   = pan speed / lines
 *
 * Rates are multiples of 1e-6 Hz and 1e-6 deg/s, so few steps are possible exactly: the nearest rates are set, and the
 * reply is the step that they give. A sphere has one step, for both. A planar head takes the steps of its profile's
 * geometries. Other heads have a fixed pattern, so their step can only be read. */
#include "firmware_sim/command/call.h"
#include "firmware_sim/command/command.h"
#include "firmware_sim/command/parse.h"
#include "firmware_sim/command/row.h"
#include "firmware_sim/command/setting.h"
#include "firmware_sim/command/step.h"

#include <stdio.h>

static const int64_t TURN_NDEG = 360000000000, HALF_UDEG = 180000000, NDEG_PER_UDEG = 1000, NANO = 1000000000;
static const int64_t LEAST_SPHERE_UDEG = 10000, MOST_SPHERE_UDEG = 90000000; /* as head.step_deg */

__extension__ typedef __int128 wide;

/* num / den to the nearest integer; both are positive or 0. */
static int64_t nearest(wide num, wide den)
{
    return (int64_t)((num + den / 2) / den);
}

/* ---- steps that a head's settings give */

int64_t command_step_ndeg(uint32_t steps)
{
    return nearest(TURN_NDEG, steps);
}

/* Returns the step of a sphere, which has a whole number of steps in a turn. */
static int64_t sphere_step(int64_t step_udeg)
{
    return HALF_UDEG % step_udeg == 0 ? step_udeg * NDEG_PER_UDEG : nearest(TURN_NDEG, emitter_sphere_steps(step_udeg));
}

static int64_t line_step(const struct command_device *dev, const struct head_settings *s)
{
    const struct head_limits *l = &dev->limits;
    if (l->emitter == EMITTER_SPHERE) return sphere_step(s->step_udeg);
    if (l->emitter == EMITTER_BEAMS) return nearest((wide)s->lines_uhz * l->sequence_ps * 360, NANO);
    if (l->emitter != EMITTER_LINE) return command_step_ndeg(head_line_pulses(l, s));
    return nearest((wide)s->lines_uhz * l->sweep_udeg * NDEG_PER_UDEG, s->prr_uhz);
}

static int64_t pan_step(const struct command_device *dev, const struct head_settings *s)
{
    if (dev->limits.emitter == EMITTER_SPHERE) return sphere_step(s->step_udeg);
    return nearest((wide)s->pan_udeg_s * NANO, s->lines_uhz);
}

/* Returns the coarser one of both steps: no two neighbours are further apart. */
static int64_t both_step(const struct command_device *dev, const struct head_settings *s)
{
    const int64_t in_line = line_step(dev, s), of_pan = dev->limits.emitter == EMITTER_LINE ? pan_step(dev, s) : 0;
    return in_line > of_pan ? in_line : of_pan;
}

/* ---- the nearest rates for a step, within the head's limits */

static int64_t most_lines(const struct command_device *dev)
{
    const int64_t most = dev->limits.lines_max_uhz, prr = dev->settings.prr_uhz;
    return most < prr ? most : prr;
}

static int64_t lines_of(const struct command_device *dev, int64_t step_ndeg)
{
    const int64_t least = dev->limits.lines_min_uhz, most = most_lines(dev);
    const int64_t lines =
        nearest((wide)step_ndeg * dev->settings.prr_uhz, (wide)dev->limits.sweep_udeg * NDEG_PER_UDEG);
    return lines < least ? least : lines > most ? most : lines;
}

static int64_t pan_of(const struct command_device *dev, int64_t step_ndeg, int64_t lines_uhz)
{
    const int64_t pan = nearest((wide)step_ndeg * lines_uhz, NANO), most = dev->limits.pan_max_udeg_s;
    return pan < most ? pan : most;
}

static int64_t step_of_lines(const struct command_device *dev, int64_t lines_uhz)
{
    return nearest((wide)lines_uhz * dev->limits.sweep_udeg * NDEG_PER_UDEG, dev->settings.prr_uhz);
}

/* Returns the largest step up to `most` at which the pan is fast enough for the lines. Both rates rise with the
 * step. */
static int64_t most_of_both(const struct command_device *dev, int64_t most)
{
    int64_t low = 0, high = most;
    while (low < high) {
        const int64_t middle = high - (high - low) / 2;
        if ((wide)middle * lines_of(dev, middle) <= (wide)dev->limits.pan_max_udeg_s * NANO)
            low = middle;
        else
            high = middle - 1;
    }
    return low;
}

/* ---- spheres: a step has to divide half a turn */

/* Returns the nearest such step at or above a step (up: 1), or at or below it. */
static int64_t whole_part(int64_t step_udeg, int up)
{
    int64_t n = HALF_UDEG / step_udeg;
    if (!up && HALF_UDEG % step_udeg != 0) n++;
    while (HALF_UDEG % n != 0)
        n += up ? -1 : 1;
    return HALF_UDEG / n;
}

/* Whether the value is DEF, which sets the rates of power-up. */
static int is_default(const struct command_call *call)
{
    return call->value.kind == COMMAND_VALUE_DEF;
}

static void sphere_range(const struct command_device *dev, int64_t *min, int64_t *max)
{
    const struct head_limits *l = &dev->limits;
    *min = *max = sphere_step(dev->settings.step_udeg);
    if (l->step_fixed) return;
    const int64_t most = l->prr_max_uhz / dev->settings.lines_uhz; /* pulses of a line */
    int64_t least_udeg = most > 0 ? (2 * HALF_UDEG + most - 1) / most : MOST_SPHERE_UDEG;
    if (least_udeg < LEAST_SPHERE_UDEG) least_udeg = LEAST_SPHERE_UDEG;
    if (least_udeg > MOST_SPHERE_UDEG) least_udeg = MOST_SPHERE_UDEG;
    *min = whole_part(least_udeg, 1) * NDEG_PER_UDEG;
    *max = MOST_SPHERE_UDEG * NDEG_PER_UDEG;
}

static int write_sphere(struct command_call *call, int64_t step_ndeg)
{
    struct command_device *dev = call->dev;
    const int64_t step_udeg = step_ndeg / NDEG_PER_UDEG;
    char low[32], high[32];
    if (is_default(call)) {
        dev->settings.step_udeg = dev->defaults.step_udeg;
        return 0;
    }
    if (step_ndeg == sphere_step(dev->settings.step_udeg)) return 0;
    if (step_ndeg % NDEG_PER_UDEG == 0 && HALF_UDEG % step_udeg == 0) {
        dev->settings.step_udeg = step_udeg;
        return 0;
    }
    int64_t min, max;
    sphere_range(dev, &min, &max);
    const int64_t below = whole_part(step_udeg, 0), above = whole_part(step_udeg + 1, 1);
    command_format_fixed(low, sizeof low, below * NDEG_PER_UDEG < min ? min / NDEG_PER_UDEG : below, 6);
    command_format_fixed(high, sizeof high, above, 6);
    return command_fail(call, CMD_E_RANGE, "%s: a sphere's step divides 180 deg; the nearest are %s and %s deg",
                        call->row->header, low, high);
}

/* ---- the three settings */

static int is_line_head(const struct command_device *dev)
{
    return dev->limits.emitter == EMITTER_LINE;
}

static int is_sphere(const struct command_device *dev)
{
    return dev->limits.emitter == EMITTER_SPHERE;
}

/* Whether the step follows from a value that is 0. No configuration has such a value, but a damaged recording may. */
static int lacks_rates(const struct command_device *dev)
{
    const struct head_settings *s = &dev->settings;
    if (is_sphere(dev)) return s->step_udeg <= 0;
    if (dev->limits.emitter == EMITTER_PLANAR) return head_line_pulses(&dev->limits, s) == 0;
    return is_line_head(dev) && (s->prr_uhz <= 0 || s->lines_uhz <= 0);
}

static const char *line_why_not(const struct command_device *dev)
{
    if (lacks_rates(dev)) return "the recording does not have this value";
    return dev->limits.emitter == EMITTER_DIRECTIONS ? "the head has a list of directions, so no step" : NULL;
}

static const char *pan_why_not(const struct command_device *dev)
{
    const int has = is_sphere(dev) || (is_line_head(dev) && dev->limits.pan_max_udeg_s > 0);
    return has ? line_why_not(dev) : "the head has no pan";
}

/* Sets the geometry with this step. The caller has checked that there is one. */
static int write_planar(struct command_call *call, int64_t step_ndeg)
{
    const struct head_limits *l = &call->dev->limits;
    for (uint32_t i = 0; i < l->n_geometries; i++)
        if (command_step_ndeg(l->geometry[i].steps) == step_ndeg)
            call->dev->settings.step_udeg = head_step_udeg(l->geometry[i].steps);
    return 0;
}

/* The range over all geometries. The caller narrows it to the steps of the present line rate. */
static void planar_range(const struct command_device *dev, int64_t *min, int64_t *max)
{
    for (uint32_t i = 0; i < dev->limits.n_geometries; i++) {
        const int64_t step = command_step_ndeg(dev->limits.geometry[i].steps);
        if (step < *min) *min = step;
        if (step > *max) *max = step;
    }
}

static void line_range(const struct command_device *dev, int64_t *min, int64_t *max)
{
    *min = *max = line_step(dev, &dev->settings);
    if (!is_line_head(dev)) return;
    *min = step_of_lines(dev, dev->limits.lines_min_uhz);
    *max = step_of_lines(dev, most_lines(dev));
}

static void pan_range(const struct command_device *dev, int64_t *min, int64_t *max)
{
    *min = *max = pan_step(dev, &dev->settings);
    if (!is_line_head(dev)) return;
    *min = 0;
    *max = nearest((wide)dev->limits.pan_max_udeg_s * NANO, dev->settings.lines_uhz);
    if (*max > TURN_NDEG) *max = TURN_NDEG;
}

static void both_range(const struct command_device *dev, int64_t *min, int64_t *max)
{
    line_range(dev, min, max);
    if (is_line_head(dev)) *max = most_of_both(dev, *max);
    if (is_sphere(dev)) sphere_range(dev, min, max);
    planar_range(dev, min, max);
}

static const char *both_why_not(const struct command_device *dev)
{
    const char *why_not = line_why_not(dev);
    int64_t min, max;
    if (why_not != NULL || !is_line_head(dev)) return why_not;
    if (dev->limits.pan_max_udeg_s <= 0) return "the head has no pan; SCAN:STEP:LINE is its step";
    both_range(dev, &min, &max);
    return min <= max ? NULL : "at this HEAD:PRR line and pan have no step in common";
}

static void say_is(const char *header, int64_t value_micro, char *text, size_t len)
{
    char number[32];
    command_format_fixed(number, sizeof number, value_micro, 6);
    snprintf(text, len, " as %s is %s", header, number);
}

static void line_because(const struct command_device *dev, char *text, size_t len)
{
    const enum emitter_kind kind = dev->limits.emitter;
    if (kind == EMITTER_LINE) say_is("HEAD:PRR", dev->settings.prr_uhz, text, len);
    if (kind == EMITTER_BEAMS) say_is("HEAD:LINes", dev->settings.lines_uhz, text, len);
    if (kind == EMITTER_PLANAR) snprintf(text, len, ": its steps are fixed");
    if (kind == EMITTER_SPHERE) snprintf(text, len, ": SCAN:STEP sets both");
}

static void pan_because(const struct command_device *dev, char *text, size_t len)
{
    if (is_sphere(dev))
        line_because(dev, text, len);
    else
        say_is("HEAD:LINes", dev->settings.lines_uhz, text, len);
}

static void both_because(const struct command_device *dev, char *text, size_t len)
{
    if (is_sphere(dev) && dev->limits.step_fixed)
        snprintf(text, len, ": the platform moves");
    else if (is_sphere(dev) || dev->limits.n_geometries > 0)
        say_is("HEAD:LINes", dev->settings.lines_uhz, text, len);
    else
        line_because(dev, text, len);
}

static int line_write(struct command_call *call, int64_t step_ndeg)
{
    struct command_device *dev = call->dev;
    if (!is_line_head(dev)) return 0;
    const int64_t lines = is_default(call) ? dev->defaults.lines_uhz : lines_of(dev, step_ndeg);
    dev->settings.lines_uhz = lines < most_lines(dev) ? lines : most_lines(dev);
    return 0;
}

static int pan_write(struct command_call *call, int64_t step_ndeg)
{
    struct head_settings *s = &call->dev->settings;
    if (!is_line_head(call->dev)) return 0;
    s->pan_udeg_s = is_default(call) ? call->dev->defaults.pan_udeg_s : pan_of(call->dev, step_ndeg, s->lines_uhz);
    return 0;
}

static int both_write(struct command_call *call, int64_t step_ndeg)
{
    if (is_sphere(call->dev)) return write_sphere(call, step_ndeg);
    if (!is_line_head(call->dev)) return write_planar(call, step_ndeg);
    line_write(call, step_ndeg);
    return pan_write(call, step_ndeg);
}

const struct command_derived command_step_both = {both_why_not, both_step, both_range, both_because, both_write};
const struct command_derived command_step_line = {line_why_not, line_step, line_range, line_because, line_write};
const struct command_derived command_step_pan = {pan_why_not, pan_step, pan_range, pan_because, pan_write};
