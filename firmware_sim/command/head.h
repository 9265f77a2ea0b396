/* The head: its state machine as a pure function, its settings, and what its profile allows. In: a state and
 * an event. Out: the next state.
 *
 * Rates and angles are integers in micro-units (uhz = 1e-6 Hz, udeg = 1e-6 degree), so that they are
 * exact. */
#ifndef FIRMWARE_SIM_COMMAND_HEAD_H
#define FIRMWARE_SIM_COMMAND_HEAD_H

#include <stdint.h>

/* The order is on the wire (telemetry, state events). */
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
    int64_t line_start_udeg, line_stop_udeg; /* start < stop, within the field of view */
    int64_t pan_start_udeg, pan_stop_udeg;   /* start <= stop, at most a turn apart */
    uint32_t frames;                         /* frames per scan; 0: until stopped */
    uint32_t station;                        /* from 1 */
    uint32_t echoes;                         /* which echoes of a pulse are sent: enum beam_select */
};

enum { HEAD_MAX_RATES = 8 };

/* What the head can do: from its profile. */
struct head_limits {
    int64_t prr_min_uhz, prr_max_uhz, lines_min_uhz, lines_max_uhz, pan_max_udeg_s;
    uint32_t n_rates;                 /* of a head with fixed pulse rates; 0: any from prr_min to prr_max */
    int64_t rate_uhz[HEAD_MAX_RATES]; /* they rise, from prr_min to prr_max */
    int64_t fov_min_udeg, fov_max_udeg;
    int64_t pan_min_udeg, pan_max_udeg;
    uint32_t n_stations;
    uint32_t line_pulses; /* of each line, so that the pulse rate follows from the lines; 0: it doesn't */
};

#endif
