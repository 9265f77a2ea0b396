/* SPDX-License-Identifier: MIT */
/* The phase lock of a rotor: at each pulse of PPS (one pulse per second) the rotor shall point to one azimuth. In this
 * file a pulse is a pulse of PPS. A pulse of the laser is called a pulse of the scan.
 *
 *     at a pulse         the speed until the next one is chosen so that the azimuth will be right then
 *     pulses not locked  the rotor runs free: at the speed that is set, with the error of its motor
 *
 * Speeds are whole micro-hertz, so an error of half of one is left after a second: 0.00018 degree. The wire has steps
 * of 0.01. The rotor turns at most half a turn more or less in that second. Where more would exceed its highest speed,
 * it turns up to one turn less. So one second is enough for any phase.
 *
 *     after a pulse   the old speed lasts until the scan's next pulse: a tick or two. A rotor that was slower by up to
 *                     a turn a second loses that part of a turn again. It then turns faster than its highest speed by
 *                     that little: it must not lose a whole turn for it in each second.
 *     slow rotors     no speed is below half of the one that is set. Below 2 turns a second a phase may need more
 *                     than one second. */
#include <math.h>

#include "firmware_sim/config/profile.h"
#include "firmware_sim/device/device_state.h"

static const double TURN_UDEG = 360e6, SECOND_NS = 1e9;
static const double ROUNDED_TURN = 1e-6; /* half a micro-hertz for a second, and the rounding of times */
static const int64_t HERTZ_UHZ = 1000000, HELD_UDEG = 10000 /* a step of the wire */;

/* Turns in -1/2..1/2. */
static double wrap(double turn)
{
    return turn - round(turn);
}

/* Returns the rotor's place in its sweep, in turns. t_ns counts from the scan's start, and is near its pulse k. */
static double turn_at(const struct schedule_segment *seg, uint64_t k, int64_t t_ns)
{
    const double since_s = (double)(t_ns - schedule_time_ns(seg, k)) / SECOND_NS;
    return schedule_sweep_turn(seg, k) + 1e-6 * (double)seg->spec.lines_uhz * since_s;
}

static int is_on(const struct device *device)
{
    const struct device_scan *scan = &device->scan;
    return device->scan.settings.phase_lock != 0 && scan->on && scan->lines_uhz % HERTZ_UHZ == 0;
}

static void set_speed(struct device *device, int64_t held_uhz)
{
    device->beam.held_uhz = held_uhz;
    if (device->scan.on) device_set_rates(&device->beam, device->scan.pulse_next);
}

/* Notes where the rotor was at the pulse. */
static void note_edge(struct device *device, double turn)
{
    struct command_phase *phase = &device->cmd.phase;
    const int64_t phase_udeg = device->scan.settings.phase_udeg;
    phase->edge_udeg = llround((turn - floor(turn)) * TURN_UDEG) % (int64_t)TURN_UDEG;
    phase->is_known = 1;
    phase->is_held = device->beam.held_uhz != 0 &&
                     fabs(wrap(turn - (double)phase_udeg / TURN_UDEG)) * TURN_UDEG <= (double)HELD_UDEG;
}

/* Returns the speed that makes up for the missing turns in left_s. A missing part of up to spare_turn is no reason to
 * lose a turn. */
static int64_t find_speed(const struct device *device, double missing, double left_s, double spare_turn)
{
    const struct config_profile *profile = site_profile(device->site);
    const double set_uhz = (double)device->scan.lines_uhz, max_uhz = (double)profile->lines_max_uhz;
    if (left_s <= 0.0) return device->scan.lines_uhz;
    if (missing > spare_turn && set_uhz + 1e6 * missing / left_s > max_uhz) missing -= 1.0;
    const double uhz = set_uhz + 1e6 * missing / left_s,
                 most_uhz = fmin(uhz, (double)emitter_most_lines_uhz(&profile->emitter));
    return llround(fmax(most_uhz, 0.5 * set_uhz));
}

/* Chooses the speed with which the azimuth is right a second after the edge. The speed holds from the scan's next pulse
 * on, the first one after the edge. */
static void hold(struct device *device, int64_t edge_ns)
{
    const struct device_scan *scan = &device->scan;
    const struct schedule_segment *seg = &scan->segment;
    const double left_s = 1.0 + (double)(edge_ns - schedule_time_ns(seg, scan->pulse_next)) / SECOND_NS;
    const double free_turn = schedule_sweep_turn(seg, scan->pulse_next) + 1e-6 * (double)scan->lines_uhz * left_s;
    const double missing = wrap((double)device->scan.settings.phase_udeg / TURN_UDEG - free_turn);
    /* A second with a whole turn less is slower by 1 / left_s, a little more than a turn a second. */
    set_speed(device, find_speed(device, missing, left_s, 2.0 * (1.0 - left_s) + ROUNDED_TURN));
}

static int is_locked(const struct device *device, int64_t t_ns)
{
    int64_t hour_ns;
    const struct pps_moment at = {t_ns, head_clock_ns(&device->clock, t_ns)};
    return pps_at(&device->pps, at, &hour_ns) == PROTOCOL_PPS_LOCKED;
}

void device_hold_phase(struct device *device, int64_t edge_ns)
{
    device->edge = (struct device_edge){1, edge_ns};
}

/* Pulses of the scan up to the edge keep the speed that was chosen before. So the edge waits until the scan's next
 * pulse is after it. */
static void take_edge(struct device *device)
{
    const struct device_scan *scan = &device->scan;
    const int64_t edge_ns = device->edge.t_ns - (int64_t)scan->tick0 * device->tick_ns;
    if (schedule_time_ns(&scan->segment, scan->pulse_next) < edge_ns) return;
    device->edge.waits = 0;
    note_edge(device, turn_at(&scan->segment, scan->pulse_next, edge_ns));
    if (is_on(device) && is_locked(device, device->edge.t_ns)) hold(device, edge_ns);
}

void device_check_phase(struct device *device, int64_t t_ns)
{
    const int turns = device->scan.on && site_profile(device->site)->emitter.kind == EMITTER_BEAMS;
    if (!turns) device->edge.waits = device->cmd.phase.is_known = device->cmd.phase.is_held = 0;
    if (device->edge.waits && device->scan.pulse_next < device->scan.segment.end_pulse) take_edge(device);
    if (device->beam.held_uhz == 0 || (is_on(device) && is_locked(device, t_ns))) return;
    device->cmd.phase.is_held = 0;
    set_speed(device, 0);
}
