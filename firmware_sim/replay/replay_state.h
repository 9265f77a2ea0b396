/* SPDX-License-Identifier: MIT */
/* Private to replay*.c: a recording that is played. */
#ifndef FIRMWARE_SIM_REPLAY_REPLAY_STATE_H
#define FIRMWARE_SIM_REPLAY_REPLAY_STATE_H

#include <pthread.h>

#include "firmware_sim/device/fault_desk.h"
#include "firmware_sim/replay/recording.h"
#include "firmware_sim/replay/replay.h"
#include "firmware_sim/replay/replay_clock.h"

enum { REPLAY_CHANGES = 32, REPLAY_FRONT = 3, REPLAY_FRONT_ROOM = 2048, REPLAY_MOST_BYTES = 1 << 20 /* of a tick */ };

/* The last descriptor, emitter and anchor of the stream. */
struct replay_front {
    uint8_t bytes[REPLAY_FRONT][REPLAY_FRONT_ROOM];
    uint32_t len[REPLAY_FRONT]; /* 0: none */
};

struct replay {
    struct config *cfg;
    struct replay_options options;
    int64_t tick_ns;
    char idn[96];
    int is_device; /* a link has another protocol than the native one */
    struct device_counters counters;
    struct fault_board *faults;
    struct fault_desk desk;

    /* under the lock */
    pthread_mutex_t lock;
    struct command_device cmd;
    int wants_start, wants_stop, wants_seek, ending;
    double seek_s; /* with wants_seek */
    double speed;  /* 0: it is paused */
    int speed_changed, loop;
    int64_t position_ns; /* of the frame that was sent last, since the first one */
    int wants_again;     /* it is to begin anew by itself */
    int n_clients;       /* sessions, but not those that links of type file, null and udp open by themselves */
    int ends_then;       /* the run ends when the recording was played */
    uint32_t times;      /* how often it was begun so far */
    uint64_t frames;     /* sent */
    uint64_t scans, frames_done;
    /* The last changes of the recorded head's state. A client sees a change once its tick is released. Change number i
     * is at i % REPLAY_CHANGES. */
    struct replay_change {
        uint64_t tick;
        enum head_state state;
    } change[REPLAY_CHANGES];
    uint32_t n_changes;
    /* 0, or the changes up to and including the one with which a command last ended the playing, or began it. Clients
     * see such a command at once, ticks before that change. */
    uint32_t stopped, begun;
    struct sh_err failure; /* code 0: none */
    /* In the first round it shows the times that the recorded head had. It then goes on. */
    struct replay_clock clock;
    struct native_anchor anchor; /* the last one */

    /* of the player's thread; until that begins, of the thread that opens */
    uint64_t n_ticks,
        end_tick; /* the run's length, and the tick at which it ends; UINT64_MAX: none, or not known yet */
    struct recording recording;
    double begin_s;   /* where it begins to play, since its first frame */
    int64_t first_ns; /* of the recording: device time of its first frame */
    struct replay_front front;
    struct replay_front first_front; /* of the recording */
    int playing;                     /* changed under the lock */
    uint64_t start_tick;             /* the tick at which it began, or at which counting began anew */
    int64_t base;                    /* the tick of the recording at start_tick */
    int64_t last;                    /* tick of the recording of the frame sent last */
    double pace;                     /* the speed at which frames are sent since start_tick */
    int64_t shift_ns;                /* of the frames being sent: the run's device time minus theirs */
    uint32_t seq_shift;              /* added to sequence numbers */
    int has_seq;                     /* a frame was sent since power-up; last_seq is its number as it was sent */
    uint32_t last_seq;
    int restarts;              /* the next frame begins another sequence */
    int in_range, has_skipped; /* in this round: frames are being sent; some were skipped before them */
    int has_frame;
    struct recording_frame frame; /* the next one */
    uint8_t *bytes;               /* of a tick */
    uint32_t len;
    struct ring_tick tick; /* counts */
};

/* replay_commands.c: sets the state from this tick on. With the lock held. */
void replay_set_state(struct replay *replay, uint64_t tick, enum head_state state);
/* Take the head's settings from frames of the stream. With the lock held. */
void replay_take_descriptor(struct replay *replay, const struct native_descriptor *descriptor);
void replay_take_emitter(struct replay *replay, const struct native_emitter *emitter);
void replay_take_anchor(struct replay *replay, const struct native_anchor *anchor);
void replay_open_commands(struct replay *replay);
/* As struct loop_source_ops has them. */
void replay_command(void *self, uint32_t session, const char *line, uint64_t released, struct command_result *out);
void replay_command_once(void *self, uint32_t session, const char *line, uint64_t released, struct command_result *out);
void replay_overlong(void *self, uint32_t session, struct command_result *out);
void replay_session_opened(void *self, uint32_t session, const char *who);
void replay_session_closed(void *self, uint32_t session, const char *who, int partial);
void replay_session_over(void *self);
void replay_report(void *self, int number, const char *text);

/* replay_player.c, by the player's thread. Begins to play with this tick. */
void replay_begin(struct replay *replay, uint64_t tick);
/* The speed has changed: the next frame is due with this tick. */
void replay_pace(struct replay *replay, uint64_t tick);
/* Fills a tick with its frames. may_skip: time without frames passes at once. */
void replay_fill(struct replay *replay, uint64_t tick, int may_skip);
void replay_stop(struct replay *replay, uint64_t tick, int wants_again);

/* replay_notes.c: a frame goes out with a tick. With the lock held; counts into replay->tick. */
void replay_note_frame(struct replay *replay, const uint8_t *frame, uint64_t tick);

/* replay_device.c: a recording as a device of another protocol than the native one. */
/* Checks that the protocol of each link can speak for the recorded head; else SH_EINPUT. e NULL: the recording has no
 * emitter frame. beams: the payload of that frame. */
int replay_check_links(struct replay *replay, const struct native_descriptor *d, const struct native_emitter *e,
                       const uint8_t *beams, struct sh_err *err);
/* As struct loop_source_ops has them. */
int64_t replay_date_ns(void *self, int64_t t_ns);
int64_t replay_next_fix_ns(void *self, int64_t t_ns);
int replay_fix(void *self, int64_t t_ns, struct nmea_fix *fix);
enum protocol_pps replay_pps(void *self, int64_t t_ns, int64_t *hour_ns);

/* replay_open.c: reads up to the first anchor, and fills in what links need. */
int replay_open_recording(struct replay *replay, struct sh_err *err);
/* Keeps a frame if it is a descriptor, an emitter or an anchor. */
void replay_keep_front(struct replay_front *front, const uint8_t *frame);

#endif
