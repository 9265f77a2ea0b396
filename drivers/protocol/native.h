/* SPDX-License-Identifier: MIT */
/* The native protocol for those who read it: bytes of a stream go in, frames, reply lines and their contents come out.
 *
 * PROTOCOL.md and its pages describe the frames byte by byte; the structs here hold the same fields in the same order
 * and units. The end of a line is core's struct line_end. native_encode.h is for those who write. Nothing here does
 * I/O, allocates or keeps global state. All integers are little-endian on the wire. */
#ifndef DRIVERS_PROTOCOL_NATIVE_H
#define DRIVERS_PROTOCOL_NATIVE_H

#include <stddef.h>
#include <stdint.h>

#include "core/bytes.h"
#include "core/line.h"
#include "drivers/protocol/native_sequence.h"

enum {
    NATIVE_SYNC = 0xd5,
    NATIVE_VERSION = 1,
    NATIVE_HEADER_LEN = 28,
    NATIVE_MAX_PAYLOAD = 65536,
    NATIVE_MAX_FRAME = NATIVE_HEADER_LEN + NATIVE_MAX_PAYLOAD,
    NATIVE_POINT_LEN = 20,
    NATIVE_POINTS_HEAD_LEN = 40,
    NATIVE_MAX_POINTS = (NATIVE_MAX_PAYLOAD - NATIVE_POINTS_HEAD_LEN) / NATIVE_POINT_LEN,
    NATIVE_POSES_HEAD_LEN = 8,
    NATIVE_POSE_LEN = 80,
    NATIVE_MAX_POSES = (NATIVE_MAX_PAYLOAD - NATIVE_POSES_HEAD_LEN) / NATIVE_POSE_LEN,
    NATIVE_ATTRIBUTES_HEAD_LEN = 16,
    NATIVE_ATTRIBUTE_LEN = 4,
    NATIVE_COLOURS_HEAD_LEN = NATIVE_ATTRIBUTES_HEAD_LEN,
    NATIVE_COLOUR_LEN = 3,
    NATIVE_SURFACES_HEAD_LEN = 8,
    NATIVE_MAX_TEXT = 512,    /* longest reply line, with its CR LF */
    NATIVE_MAX_COMMAND = 256, /* longest command line, without its end */
};

enum native_type {
    NATIVE_DESCRIPTOR = 1, /* device, format, head geometry */
    NATIVE_ANCHOR = 2,     /* CRS, double anchor, scale, head -> scene rotation */
    NATIVE_POINTS = 3,     /* part of one line */
    NATIVE_LINE_END = 4,
    NATIVE_TELEMETRY = 5,
    NATIVE_EVENT = 6,
    NATIVE_SURFACES = 7,   /* names of some labels */
    NATIVE_POSES = 8,      /* where a moving head is while it measures what follows */
    NATIVE_ATTRIBUTES = 9, /* amplitude and width of the points in the frame before */
    NATIVE_EMITTER = 10,   /* how the head's beams are arranged; after the descriptor, unless it is a line head */
    NATIVE_COLOURS = 11,   /* a colour for each of the points in the last points frame */
    NATIVE_WAVES = 12,     /* waveforms of the pulses in the last points frame: native_waves.h */
};

enum native_flags {
    NATIVE_REPEAT = 1 << 0, /* was sent before (descriptor, emitter, anchor): not in the stream hash */
    NATIVE_LOCAL = 1 << 1,  /* made for this reader alone: seq is 0 and not counted */
};

/* The header of the whole frame at `frame`. */
void native_read_header(const uint8_t *frame, struct native_header *header);
/* Bytes of that frame: header and payload. The one place that knows where a frame's length stands. */
static inline size_t native_frame_len(const uint8_t *frame)
{
    return NATIVE_HEADER_LEN + (size_t)le_get32(frame + 4);
}

/* Adds to the device time of the whole frame at `frame`. The header's checksum is then wrong. */
static inline void native_shift_time(uint8_t *frame, int64_t by_ns)
{
    le_put64(frame + 16, le_get64(frame + 16) + (uint64_t)by_ns);
}

enum native_layout { NATIVE_POLAR = 0, NATIVE_GEO = 1 };

struct native_descriptor {
    char idn[96]; /* what *IDN? answers */
    char profile[32];
    uint32_t layout;                         /* enum native_layout */
    uint32_t isa;                            /* rays that the caster takes at once: 1, 4, 8, 16 */
    uint64_t prr_uhz, lines_uhz, pan_udeg_s; /* micro-hertz, micro-degrees per second */
    int64_t fov_min_udeg, sweep_udeg;        /* whole sweep: where it starts, how far it goes */
    int64_t line_start_udeg, line_stop_udeg; /* pulses outside are fired, counted, not cast */
    int64_t pan_start_udeg, pan_stop_udeg;
    double mirror_counts_per_turn, pan_counts_per_turn; /* encoder counts; angle = 2 pi count / counts_per_turn */
    double range_scale_m;                               /* polar: metres per count */
    double range_min_m, range_max_m;
    uint32_t max_echoes, n_surfaces, frames, scan; /* pan sweeps of a scan (0: endless); scan number from 1 */
    uint64_t seed;
    uint32_t content, reserved; /* enum native_content; where content is 0, neither is sent */
};

/* How beams are arranged. All arrangements have the same two angles in a polar point: the mirror count is the
 * elevation, the pan count the azimuth, clockwise from y seen from above; direction = (sin pan cos mirror, cos pan
 * cos mirror, sin mirror). */
enum native_emitter_kind {
    NATIVE_EMIT_LINE = 0,   /* a mirror sweeps the elevation, the pan turns slowly. No frame is sent. */
    NATIVE_EMIT_PLANAR = 1, /* one plane, elevation 0: `steps` a turn; a line is a turn, from step 0 on */
    NATIVE_EMIT_BEAMS = 2,  /* a firing sequence of beams spins about the vertical; a line is a turn, from azimuth 0 */
    NATIVE_EMIT_SPHERE =
        3, /* rings of one elevation each, `steps` a turn; a line is a ring, a pan sweep is all rings. Rings at -90
            * and 90 degrees are poles, where one pulse is cast */
    NATIVE_EMIT_DIRECTIONS = 4, /* a list; a line and a pan sweep are the list once */
};
struct native_emitter { /* begin of an emitter payload, 64 bytes; then n_beams of 12 */
    uint32_t kind, n_beams;
    uint32_t steps;                /* planar, sphere: of a turn; directions: length of the list; beams: 0 */
    int32_t first_step, last_step; /* planar: range of steps that are cast, both included */
    int32_t front_step;            /* planar, sphere: the step that looks along y */
    int32_t turn;                  /* +1: steps and azimuth go clockwise seen from above, -1: the other way */
    uint32_t rings;                /* sphere */
    uint64_t sequence_ns_num, sequence_ns_den; /* num / den ns is the time of a firing sequence (beams) or a pulse */
    int64_t first_ring_udeg; /* sphere: elevation of ring 0, rounded; the others follow by 180 deg / gaps */
    uint32_t echoes;         /* enum native_echoes: which echoes of a pulse are sent */
    uint32_t gaps; /* sphere: gaps between rings from pole to pole, where not all rings are scanned; 0: rings - 1 */
};
enum native_echoes {
    NATIVE_ECHOES_ALL = 0,
    NATIVE_ECHOES_FIRST = 1,
    NATIVE_ECHOES_LAST = 2,
    NATIVE_ECHOES_STRONGEST = 3
};
enum { NATIVE_EMITTER_HEAD_LEN = 64, NATIVE_BEAM_LEN = 12, NATIVE_MAX_BEAMS = 128 };
struct native_beam { /* 0 i32 elevation, 4 i32 azimuth offset, 8 u32 firing time after the sequence's first, ns */
    int32_t elevation_udeg, azimuth_udeg;
    uint32_t offset_ns;
};

enum native_content {
    NATIVE_HAS_ATTRIBUTES = 1, /* a frame of attributes follows each points frame */
    NATIVE_HAS_COLOURS = 2,    /* a frame of colours follows each points frame, after its attributes */
    NATIVE_HAS_WAVES = 4,      /* frames of waveforms follow each points frame, after both */
    NATIVE_HAS_DEVIATIONS = 8, /* attributes have deviations after their records */
};

/* Geodetic coordinates and the angles of the descriptor are in degrees. */
#define NATIVE_RAD_PER_DEG (3.14159265358979323846 / 180.0)

enum native_crs { NATIVE_CRS_LOCAL = 0, NATIVE_CRS_ECEF = 1, NATIVE_CRS_UTM = 2, NATIVE_CRS_GEODETIC = 3 };
enum native_heights { NATIVE_HEIGHTS_ELLIPSOID = 0, NATIVE_HEIGHTS_GEOID = 1 };

enum native_moving {
    NATIVE_MOVING = 1, /* the head moves, see NATIVE_POSES */
    NATIVE_STOP = 2,   /* it stands at a stop of a trajectory; `frame` is the stop's */
};

struct native_anchor {
    uint32_t crs;     /* enum native_crs */
    uint32_t epsg;    /* 0 for local */
    uint32_t station; /* number, from 1 */
    uint32_t moving;  /* enum native_moving */
    double anchor[3]; /* of the station in the CRS, metres; geodetic: degrees, degrees, metres */
    double scale_m;   /* geo: upper bound of a count's length on the ground, metres */
    double lat_deg, lon_deg, height_m;
    double station_m[3]; /* of the station in the scene frame */
    double rotation[9];  /* socs -> scene frame, row by row: p_prcs = station_m + rotation * p_socs */
    double scale[3];     /* geo: position = anchor + scale[k] * count[k]; 0: scale_m */
    uint32_t heights;    /* enum native_heights, of utm and geodetic */
    uint32_t until_ms;   /* time in the scan until which it holds; 0: for all points that follow */
    double axes[9]; /* differences in the scene frame at the anchor -> axes of the CRS, row by row, without its scale;
                       geodetic: -> east, north, up. All 0: the unit matrix */
    double frame;   /* at a stop: frame scalar of the trajectory */
};

struct native_points {    /* begin of a points payload, 40 bytes; then n points of 20 */
    uint32_t frame, line; /* numbers of the pan sweep and of the line, from 0 */
    uint64_t pulse0;
    int64_t t0_ns, line_t0_ns; /* since the scan's start */
    uint32_t n_pulses, n_points;
};

/* Times of a stream may be any: their differences and sums wrap instead of overflowing. */
static inline int64_t native_since_ns(int64_t t_ns, int64_t t0_ns)
{
    return (int64_t)((uint64_t)t_ns - (uint64_t)t0_ns);
}

static inline int64_t native_after_ns(int64_t t0_ns, int64_t dt_ns)
{
    return (int64_t)((uint64_t)t0_ns + (uint64_t)dt_ns);
}

/* 20 bytes: 0 u32 a, 4 u32 b, 8 u32 c, 12 i16 reflectance 0.01 dB, 14 u16 label,
 * 16 u32: bits 0..23 time after t0_ns in ns, 24..27 echo number, 28..31 echo count */
struct native_point {
    uint32_t a, b, c;
    int16_t refl_cdb;
    uint16_t label;
    uint32_t dt_ns;
    uint8_t echo, echo_count; /* both 0: shot without echo */
};

/* Takes the five words of a point apart. */
static inline struct native_point native_point_of(const uint32_t word[5])
{
    return (struct native_point){.a = word[0],
                                 .b = word[1],
                                 .c = word[2],
                                 .refl_cdb = (int16_t)(uint16_t)word[3],
                                 .label = (uint16_t)(word[3] >> 16),
                                 .dt_ns = word[4] & 0xffffffu,
                                 .echo = (uint8_t)(word[4] >> 24 & 15u),
                                 .echo_count = (uint8_t)(word[4] >> 28)};
}

/* Point i < n_points of a checked points payload. Inline, for readers of millions a second. */
static inline void native_decode_point(const uint8_t *payload, uint32_t i, struct native_point *out)
{
    const uint8_t *p = payload + NATIVE_POINTS_HEAD_LEN + (size_t)i * NATIVE_POINT_LEN;
    const uint32_t word[5] = {le_get32(p), le_get32(p + 4), le_get32(p + 8), le_get32(p + 12), le_get32(p + 16)};
    *out = native_point_of(word);
}

/* Counts among the first n points the shots without an echo, and the echoes whose reflectance is modelled. */
void native_count_points(const uint8_t *payload, uint32_t n, uint32_t *n_empty, uint32_t *n_reflectances);

struct native_attributes { /* begin of an attributes payload, 16 bytes; then n attributes of 4. Begin of a colours
                            * payload, too; then n colours of 3: u8 red, green, blue, sRGB */
    uint64_t pulse0;
    uint32_t line, n_points; /* all three as in the points frame before it */
};

enum { NATIVE_AMPLITUDE_NONE = INT16_MIN, NATIVE_WIDTH_NONE = 0, NATIVE_WIDTH_MOST = UINT16_MAX };
/* 4 bytes: 0 i16 amplitude, 2 u16 width */
struct native_attribute {
    int16_t amplitude_cdb; /* 0.01 dB above the detection threshold */
    uint16_t width_cns;    /* 0.01 ns, full at half maximum */
};

/* Attribute i < n_points of a checked attributes payload. */
static inline void native_decode_attribute(const uint8_t *payload, uint32_t i, struct native_attribute *out)
{
    const uint8_t *p = payload + NATIVE_ATTRIBUTES_HEAD_LEN + (size_t)i * NATIVE_ATTRIBUTE_LEN;
    out->amplitude_cdb = (int16_t)le_get16(p);
    out->width_cns = le_get16(p + 2);
}

enum native_pose_flags { /* the values of core/pose.h */
                         NATIVE_POSE_EXTRAPOLATED = 1,
                         NATIVE_POSE_LATE = 2,
                         NATIVE_POSE_NONE = 4,
};
struct native_pose {
    int64_t t_ns;         /* since the scan's start */
    double position_m[3]; /* of the head, scene frame */
    double quat[4];       /* w x y z, of length one: head's frame -> scene frame */
    double frame;         /* frame scalar of the trajectory */
    uint32_t flags, reserved;
};

/* A head that follows a PTP master. Port states have the numbers of IEEE 1588 and the names of linuxptp. */
enum native_ptp_port {
    NATIVE_PTP_NONE = 0, /* the head follows no master */
    NATIVE_PTP_INITIALIZING = 1,
    NATIVE_PTP_FAULTY = 2,
    NATIVE_PTP_LISTENING = 4,
    NATIVE_PTP_UNCALIBRATED = 8,
    NATIVE_PTP_SLAVE = 9,
};
enum native_ptp_servo { NATIVE_PTP_UNLOCKED = 0, NATIVE_PTP_JUMP = 1, NATIVE_PTP_LOCKED = 2 }; /* s0, s1, s2 */
enum { NATIVE_PTP_UTC_VALID = 1 };                                                             /* of ptp_flags */

struct native_telemetry {
    uint32_t state; /* enum head_state, in its order */
    uint32_t scan;
    uint64_t pulses, echoes, lines, lost_pulses, late_blocks;
    uint32_t late_max_us, errors_queued;
    uint64_t reader_lost_frames;               /* always 0: events READER_LOST have it */
    int64_t utc_ns;                            /* UTC of this frame's device time, ns since 1970, 0 when unknown */
    uint64_t scan_fired, scan_cast, scan_lost; /* pulses of that scan up to here */
    uint64_t lost_lines;                       /* missing in the head's files; sent where it is not 0, and with PTP */
    /* sent where ptp_port is not 0: */
    uint32_t ptp_port, ptp_servo; /* enum native_ptp_port, native_ptp_servo */
    int64_t ptp_offset_ns;        /* of the head's clock from the master, as last measured */
    int64_t ptp_delay_ns;         /* mean of the two ways */
    uint64_t ptp_grandmaster;     /* its identity, as EUI-64; 0: none */
    uint32_t ptp_class, ptp_accuracy, ptp_flags, ptp_reserved; /* of the grandmaster, as IEEE 1588 lists them */
};

enum native_event_code {
    NATIVE_EV_STATE = 1,       /* a: new state, b: state before */
    NATIVE_EV_SCAN_START = 2,  /* a: scan number, b: device time of pulse 0, ns, c: its GPS time, ns; 0: unknown */
    NATIVE_EV_SCAN_END = 3,    /* a: scan number, b: pulses fired, c: pulses lost */
    NATIVE_EV_OVERRUN = 4,     /* the head could not keep up; a: first lost pulse, b: pulses lost, c: ticks lost */
    NATIVE_EV_READER_LOST = 5, /* this reader could not follow; a: frames lost now, b: pulses in them, c: frames lost
                                  in all */
    NATIVE_EV_CONTROL = 6,     /* who may command; a: session number, 0: nobody */
    NATIVE_EV_ERROR = 7,       /* a: SCPI error number (two's complement), b: session, 0: the head, c: 0, or how many
                                  errors of the session were held back */
    NATIVE_EV_SETTINGS = 8,    /* a: first pulse with the new settings */
    NATIVE_EV_POSE_LATE = 9,   /* no pose in time; a: poses made up so far, c: ns since the last one that came;
                                  0: none of that time or before came */
    NATIVE_EV_PPS = 10,  /* a full second of the head's clock; a: UTC, s since 1970, b: device time of the edge, ns,
                           c: GPS time, s; the text is the UTC */
    NATIVE_EV_TIME = 11, /* the head's clock, before each repeated descriptor; a: 0, b: device time, ns, c: its GPS
                            time, ns */
    NATIVE_EV_SITE = 12, /* a station was moved; a: its number, b: warnings that its place gave rise to; the text is its
                            name */
    NATIVE_EV_PTP = 13,  /* port or servo of the PTP follower changed; a: port + 256 * servo, b: device time, ns, c: the
                            grandmaster, 0: none; the text is that of a line of ptp4l */
};
struct native_event {
    uint32_t code, reserved;
    uint64_t a, b, c;
    char text[96];
};

/* ---- decoding payloads: 0, or SH_EFORMAT where length or content is wrong. No pointer is kept. */
int native_decode_descriptor(const uint8_t *payload, size_t len, struct native_descriptor *out);
int native_decode_anchor(const uint8_t *payload, size_t len, struct native_anchor *out);
/* Beams follow at NATIVE_EMITTER_HEAD_LEN; native_decode_beam. */
int native_decode_emitter(const uint8_t *payload, size_t len, struct native_emitter *out);
void native_decode_beam(const uint8_t *payload, uint32_t i, struct native_beam *out); /* i < n_beams */
int native_decode_points(const uint8_t *payload, size_t len, struct native_points *out);
int native_decode_attributes(const uint8_t *payload, size_t len, struct native_attributes *out);
int native_decode_colours(const uint8_t *payload, size_t len, struct native_attributes *out);
int native_decode_line_end(const uint8_t *payload, size_t len, struct line_end *out);
int native_decode_telemetry(const uint8_t *payload, size_t len, struct native_telemetry *out);
int native_decode_event(const uint8_t *payload, size_t len, struct native_event *out);
/* Poses payload: u32 n (2 and more), u32 0, then n poses of 80 bytes, their times rising. */
int native_decode_poses(const uint8_t *payload, size_t len, uint32_t *n);
void native_decode_pose(const uint8_t *payload, uint32_t i, struct native_pose *out); /* i < n of checked poses */
/* Surfaces payload: u32 first label, u32 count, then per label: u8 len, object, u8 len, material (no NUL).
 * Calls fn for each; names are NUL-terminated copies that live during the call. */
int native_decode_surfaces(const uint8_t *payload, size_t len,
                           void (*fn)(void *ctx, uint32_t label, const char *object, const char *material), void *ctx);

/* ---- the parser: bytes in, frames and reply lines out, in order.
 *
 * native_parser_room() gives a place for the next bytes and its size. native_parser_added() takes how many
 * came. native_parser_next() then gives items until it returns NATIVE_MORE.
 * Resynchronisation: a sync byte counts only with a correct header CRC. A frame whose payload CRC is wrong is
 * not skipped; the search goes on at its second byte. So lost bytes cost only the frames that they belonged
 * to. Text is taken only in step: after garbage, reply lines are ignored until the next good frame.
 * Frames that came already, or too late, are dropped: native_parser_next() passes over them. */
enum native_item { NATIVE_MORE = 0, NATIVE_FRAME = 1, NATIVE_TEXT = 2 };

struct native_stats {
    uint64_t frames, bytes, texts;   /* items given, and all bytes */
    uint64_t bad_payload, bad_bytes; /* frames with a wrong payload CRC; bytes that belong to no item */
    uint64_t seq_gaps, seq_lost;     /* jumps in seq, both ways; frames missing by forward jumps */
    uint64_t repeated, late;         /* frames dropped: they had come before; they came after newer ones */
    uint64_t restarts, cuts;         /* jumps back to another sequence; connections that ended within an item */
    uint64_t bad_unseen; /* frames of bad_payload that no gap shows: before a sequence's first frame, after its last */
};

/* Something wrong in the stream; scanhead.h says what n and at_byte mean for each kind. */
struct native_notice {
    enum native_notice_kind kind;
    uint32_t seq;
    uint64_t at_byte, n;
    int64_t t_ns; /* NATIVE_NO_TIME: no frame has come yet */
};
#define NATIVE_NO_TIME INT64_MIN

/* A run of bytes that belong to no item. The run's notice is given once the run ends. */
struct native_bad {
    enum native_notice_kind kind; /* NATIVE_NO_NOTICE: there is no such run now */
    int has_header;               /* the run begins with a correct header, whose values follow: */
    int is_local;
    uint32_t seq;
    int64_t t_ns;
    uint64_t at_byte, n, most; /* n: bytes so far; most: length of the frame with that header */
};

struct native_parser {
    uint8_t buf[2 * NATIVE_MAX_FRAME];
    const uint8_t *lent; /* the bytes lie there; NULL: in buf */
    size_t start, end;
    int in_step, finished;
    struct native_sequence sequence;
    struct native_bad bad;
    uint64_t bad_before; /* bad_unseen up to the sequence's first frame */
    int64_t last_t_ns;   /* of the last whole frame */
    struct native_stats stats;
    /* Called from within native_parser_next and native_parser_resume, in the order of the stream: a notice comes before
     * the item that follows it. NULL (after native_parser_init): nobody listens. */
    void (*notice)(void *ctx, const struct native_notice *notice);
    void *notice_ctx;
    /* the item found last: valid until the next call of any parser function */
    struct native_header header;
    const uint8_t *frame; /* header and payload as on the wire */
    const uint8_t *payload;
    char text[NATIVE_MAX_TEXT]; /* without CR LF */
    uint64_t text_at;           /* where it begins in all bytes */
};

void native_parser_init(struct native_parser *parser);
uint8_t *native_parser_room(struct native_parser *parser, size_t *room); /* room is never 0 after NATIVE_MORE */
void native_parser_added(struct native_parser *parser, size_t n);
/* Gives the parser whole items that this process made in memory, without a copy, in place of native_parser_room() and
 * native_parser_added(). The items stay there until the parser has given them all and the last one is no longer used.
 * CRCs of payloads are not checked, since nothing can have changed them. To be called after NATIVE_MORE; or at any time
 * with n 0, which drops the items that were not given yet. A parser gets all its bytes in one of the two ways. */
void native_parser_lend(struct native_parser *parser, const uint8_t *items, size_t n);
enum native_item native_parser_next(struct native_parser *parser);
/* Nothing more will be added. An incomplete frame is then searched as garbage, so that whole frames after a cut
 * one come out at the end of a recording, too. */
void native_parser_finish(struct native_parser *parser);
/* After native_parser_finish() and all its items: bytes of another connection to the same head will follow.
 * Counters and sequence go on (native_sequence_resume). Items that were not taken are bad bytes. */
void native_parser_resume(struct native_parser *parser);

/* Returns 1 if a frame with this header belongs to stream_sha256. Such frames are descriptor, emitter, anchor, points,
 * line-end, poses, attributes, colours and waveforms frames with neither NATIVE_REPEAT nor NATIVE_LOCAL. The hash runs
 * over u8 type, u32 length (LE) and the payload of each. */
int native_is_hashed(const struct native_header *header);

#endif
