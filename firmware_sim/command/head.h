/* SPDX-License-Identifier: MIT */
/* The head: its state machine as a pure function, its settings, and the limits from its profile. In: a state and
 * an event. Out: the next state.
 *
 * Rates and angles are integers in micro-units (uhz = 1e-6 Hz, udeg = 1e-6 degree), distances in nanometres, so
 * that they are exact. */
#ifndef FIRMWARE_SIM_COMMAND_HEAD_H
#define FIRMWARE_SIM_COMMAND_HEAD_H

#include <stdint.h>

#include "core/emitter.h"

/* Telemetry and state events send these numbers, so their order stays. */
enum head_state {
    HEAD_OFF,
    HEAD_BOOT,
    HEAD_IDLE,
    HEAD_SPIN_UP,
    HEAD_SCANNING,
    HEAD_SPIN_DOWN,
    HEAD_FAULT,
    HEAD_N_STATES
};

enum head_event {
    HEAD_EV_POWER_ON,  /* power applied */
    HEAD_EV_POWER_OFF, /* power removed, from any state */
    HEAD_EV_BOOTED,    /* self test done */
    HEAD_EV_START,     /* command: start a scan */
    HEAD_EV_SPUN_UP,   /* mirror at speed */
    HEAD_EV_STOP,      /* command: stop */
    HEAD_EV_DONE,      /* the commanded number of frames is scanned */
    HEAD_EV_SPUN_DOWN, /* mirror at rest */
    HEAD_EV_FAIL,      /* something broke */
    HEAD_EV_RESET,     /* command *RST: back to idle, defaults; clears a fault */
    HEAD_N_EVENTS
};

/* The next state (which may be the same one), or -1: the event is refused and the state stays. Defined for
 * all pairs. */
int head_next_state(enum head_state state, enum head_event event);

const char *head_state_name(enum head_state state); /* "off", "boot", "idle", "spin-up", ... */

/* The most frames of a scan (0 is without end), for head.frames, SCAN:FRAMes and --frames. */
enum { HEAD_MAX_FRAMES = 1000000 };

struct head_settings {
    int64_t prr_uhz, lines_uhz, pan_udeg_s;
    int64_t line_start_udeg, line_stop_udeg; /* within the field of view; start < stop, or != with head_limits.round */
    int64_t pan_start_udeg, pan_stop_udeg;   /* start <= stop, at most a turn apart */
    uint32_t frames;                         /* frames per scan; 0: until stopped */
    uint32_t station;                        /* from 1 */
    uint32_t echoes;                         /* which echoes of a pulse are sent: enum beam_select */
    uint32_t noise;                          /* of ranges: enum config_range_noise */
    uint32_t angle_noise;                    /* 0: none */
    uint32_t phase_lock;                     /* 1: the rotor's phase is held to the receiver's PPS pulses */
    int64_t phase_udeg;                      /* the rotor's azimuth at a PPS pulse */
    int64_t range_min_nm, range_max_nm;      /* nothing nearer or farther is an echo */
    int64_t sigma_nm, ball_nm;               /* fixed part of the range noise, one sigma; radius of the ball noise */
    int64_t step_udeg;                       /* of a sphere, as it was set; of a planar head with geometries; else 0 */
    uint32_t waves;                          /* 1: waveforms are sent */
};

enum { HEAD_MAX_RATES = 8 };

/* A line rate that a planar head has, and the steps of a turn at it. */
struct head_geometry {
    int64_t lines_uhz;
    uint32_t steps;
};

/* The angle of a step, for a number of steps per turn. emitter_sphere_steps() is its inverse, for up to 18000 steps. */
static inline int64_t head_step_udeg(uint32_t steps)
{
    return (360000000 + steps / 2) / steps;
}

/* The limits of the head, from its profile. */
struct head_limits {
    int64_t prr_min_uhz, prr_max_uhz, lines_min_uhz, lines_max_uhz, pan_max_udeg_s;
    uint32_t n_rates;                 /* of a head with fixed pulse rates; 0: any from prr_min to prr_max */
    int64_t rate_uhz[HEAD_MAX_RATES]; /* they rise, from prr_min to prr_max */
    int64_t fov_min_udeg, fov_max_udeg;
    int64_t pan_min_udeg, pan_max_udeg;
    uint32_t n_stations;
    uint64_t elsewhere;    /* bit i: station i + 1 has another scanner than this head; 0 beyond 64 */
    uint32_t n_geometries; /* of a planar head with a list of line rates; 0: any line rate, at one step */
    struct head_geometry geometry[HEAD_MAX_RATES];
    uint32_t line_pulses; /* pulses of each line, from which the pulse rate follows; 0: it doesn't. Where the step can
                           * be set, this is the number at the step of power-up: head_line_pulses() */
    int round; /* line angles are azimuths of a ring: a window may go across 0, from a start above its stop */
    enum emitter_kind emitter;
    int64_t sweep_udeg;  /* a line head: how far the beam turns in a line, with the blind part */
    int64_t sequence_ps; /* a head with beams: from firing sequence to firing sequence */
    int step_fixed;      /* a head on a platform that moves keeps its step */
    int64_t range_min_nm, range_max_nm;
    /* range_min may be at most near_most, and range_max at least far_least: then some range is left at each rate. */
    int64_t near_most_nm, far_least_nm;
    /* The largest head_settings.noise and angle_noise. noise_most is 0 where echoes are found in samples. */
    uint32_t noise_most, angle_most;
    uint32_t phase_lock_most; /* 1: it has a rotor whose phase can be held */
    uint32_t waves_most;      /* 1: it samples waveforms, and may send them */
    int64_t sigma_min_nm, ball_max_nm;
};

/* The pulses of each line; 0: as many as the rates give. */
static inline uint32_t head_line_pulses(const struct head_limits *limits, const struct head_settings *settings)
{
    if (settings->step_udeg <= 0) return limits->line_pulses;
    return emitter_sphere_steps(settings->step_udeg);
}

static inline int head_is_elsewhere(const struct head_limits *limits, int64_t station)
{
    return station >= 1 && station <= 64 && (limits->elsewhere >> (station - 1) & 1) != 0;
}

#endif
