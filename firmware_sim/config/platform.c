/* SPDX-License-Identifier: MIT */
/* Checks of the platform's keys against each other: the part of a trajectory, and the places and times of stops. The
 * length of a trajectory is known only from its file (firmware_sim/site/platform.c). */
#include "firmware_sim/config/check_places.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/given.h"

static int has_trajectory(const struct config_platform *p)
{
    return p->file[0] != '\0' || p->waypoints[0] != '\0';
}

/* Converts frames to seconds. */
static void take_frames(struct cfg_reader *rd, struct config_platform *p)
{
    static const char *const seconds[] = {"platform.start_s", "platform.end_s", "platform.step_s"};
    static const char *const frames[] = {"platform.first_frame", "platform.last_frame", "platform.frame_step"};
    if (!cfg_is_given(rd, "platform.frames_per_s") || !(p->frames_per_s > 0.0)) {
        for (int i = 0; i < 3; i++)
            if (cfg_is_given(rd, frames[i]))
                cfg_fail_key(rd, frames[i], "frames need platform.frames_per_s; allowed above 0, up to 1e6");
        return;
    }
    for (int i = 0; i < 3; i++)
        if (cfg_is_given(rd, seconds[i]))
            cfg_fail_key(rd, seconds[i], "with platform.frames_per_s the stops are given in frames; allowed is %s",
                         frames[i]);
    p->has_end = cfg_is_given(rd, "platform.last_frame");
    if (p->has_end && p->last_frame < p->first_frame)
        cfg_fail_key(rd, "platform.last_frame", "%.9g, and platform.first_frame is %.9g; allowed at least %.9g",
                     p->last_frame, p->first_frame, p->first_frame);
    p->start_s = p->first_frame / p->frames_per_s;
    p->end_s = p->last_frame / p->frames_per_s;
    p->step_s = p->frame_step / p->frames_per_s;
}

static void check_stops(struct cfg_reader *rd, const struct config *cfg)
{
    static const char *const mount[] = {"platform.mount_m", "platform.mount_heading_deg", "platform.mount_pitch_deg",
                                        "platform.mount_roll_deg"};
    const struct config_platform *p = &cfg->platform;
    if (!(p->step_s > 0.0) && CFG_SOUND(rd, "platform.step_s"))
        cfg_fail_key(rd, cfg_is_given(rd, "platform.step_s") ? "platform.step_s" : "platform.kind",
                     "stops need platform.step_s, the time from each stop to the next; allowed above 0, up to 1e9 s");
    if (has_trajectory(p)) {
        if (cfg->n_stations > 1)
            cfg_fail_key(
                rd, "stations",
                "%u stations, but with platform.kind: stops the stops are the stations; allowed one station, which "
                "gives the place of the scene on the Earth",
                cfg->n_stations);
        return;
    }
    if (!p->has_end && CFG_SOUND(rd, "platform.end_s", "platform.last_frame"))
        cfg_fail_key(
            rd, "platform.kind",
            "stops without a trajectory, at the stations, need an end; allowed is platform.end_s (or last_frame "
            "with frames_per_s), or a trajectory: platform.file or platform.waypoints");
    for (int i = 0; i < 4; i++)
        if (cfg_is_given(rd, mount[i]))
            cfg_fail_key(rd, mount[i], "without a trajectory the head is at its station; allowed is stations[]");
}

static void check_part(struct cfg_reader *rd, struct config *cfg)
{
    struct config_platform *p = &cfg->platform;
    int stops = p->kind == PLATFORM_STOPS;
    p->has_end = cfg_is_given(rd, "platform.end_s");
    if (p->has_end && (stops ? p->end_s < p->start_s : p->end_s <= p->start_s) && CFG_SOUND(rd, "platform.start_s"))
        cfg_fail_key(rd, "platform.end_s", "%.9g s, and platform.start_s is %.9g; allowed %s %.9g s", p->end_s,
                     p->start_s, stops ? "at least" : "more than", p->start_s);
    if (!stops) return;
    take_frames(rd, p);
    check_stops(rd, cfg);
}

void cfg_check_platform(struct cfg_reader *rd, struct config *cfg)
{
    const struct config_platform *p = &cfg->platform;
    if (!CFG_SOUND(rd, "platform.kind") || !cfg_check_platform_keys(rd, p)) return;
    if (p->kind == PLATFORM_LIVE && cfg->loop.pace == PACE_FAST)
        cfg_fail_key(rd, "loop.pace", "a live platform gets its poses in real time; allowed realtime, step");
    if (p->kind != PLATFORM_TRAJECTORY && p->kind != PLATFORM_STOPS) return;
    const int both = p->file[0] != '\0' && p->waypoints[0] != '\0', none = !has_trajectory(p);
    if ((both || (none && p->kind == PLATFORM_TRAJECTORY)) && CFG_SOUND(rd, "platform.file", "platform.waypoints"))
        cfg_fail_key(rd, both ? "platform.waypoints" : "platform.kind",
                     "a trajectory comes from one file; allowed either platform.file or platform.waypoints");
    check_part(rd, cfg);
}
