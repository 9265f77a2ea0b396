/* SPDX-License-Identifier: MIT */
/* libscanhead: the client side of a scan head. The library connects, sends commands, and hands out frames and points.
 *
 * The stream is the native protocol (drivers/protocol/PROTOCOL.md). `make install` installs this header, which needs no
 * other header of the project. In ten lines:
 *
 *     struct scanhead *sh;
 *     struct scanhead_frame frame;
 *     struct scanhead_point point[256];
 *     char reply[256], err[256];
 *     if (scanhead_open("tcp:127.0.0.1:5025", &sh, err, sizeof err) != 0) ...
 *     scanhead_command(sh, "SCAN:START", reply, sizeof reply, 1000);
 *     while (scanhead_next(sh, &frame, -1) == 0)
 *         if (frame.type == SCANHEAD_POINTS)
 *             n = scanhead_points(sh, &frame, 0, point, 256);
 *     scanhead_close(sh);
 *
 * Results: functions return 0, or a count, or a negative SCANHEAD_E. After an error scanhead_error() has a line of
 * text. Functions that take a const handle leave that text as it was. A timeout_ms below 0 is no time limit; a signal
 * then ends the wait of scanhead_next and scanhead_command with SCANHEAD_ETIMEOUT.
 *
 * Ownership: a value that a function returns, or writes into the caller's memory, is the caller's. Strings and
 * payloads are the handle's; the comment of each says how long they live.
 *
 * Threads: a handle belongs to one thread at a time. Different handles are independent.
 *
 * Units: names carry them: _m metres, _rad radians, _deg degrees, _ns nanoseconds, _db decibels. NaN: no value. */
#ifndef SCANHEAD_H
#define SCANHEAD_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The version of this release. Program, library and libscanhead.pc take it from here. */
#define SCANHEAD_VERSION     "1.0.0"
#define SCANHEAD_API_VERSION 1

/* Returns SCANHEAD_VERSION of the library that the program runs with. */
const char *scanhead_version(void);

enum scanhead_error {
    SCANHEAD_OK = 0,
    SCANHEAD_EINPUT = -1, /* a bad argument or source */
    SCANHEAD_EIO = -2,    /* the operating system refused */
    SCANHEAD_ENOMEM = -3,
    SCANHEAD_EPERM = -4,    /* a permission is missing; the text says which */
    SCANHEAD_ETIMEOUT = -5, /* nothing came in time; call again */
    SCANHEAD_ECLOSED = -6,  /* the head is gone, or the file is at its end */
    SCANHEAD_EFORMAT = -7,  /* not this protocol */
    SCANHEAD_ESTATE = -8,   /* not possible now, for instance points before descriptor and anchor have come */
    SCANHEAD_ELOST = -9,    /* the head was unplugged, or isn't there */
    SCANHEAD_ERESET = -10,  /* the USB bus was reset: the head is there, the session is over */
};

struct scanhead;

/* Opens a head, or a recording of its stream. source is one of:
 *   "usb", "usb:vid:pid", "usb:vid:pid:serial"   the head's own USB interface; ids in hexadecimal
 *   "tty:/dev/ttyACM0"                           a serial port or pty
 *   "tcp:host:port"
 *   "fd:N"                                       an open descriptor, of no other handle; closed at the end
 *   PATH                                         a raw stream (.shs), or its frames as packets (.pcapng)
 * On failure *out is NULL, and err (may be NULL) gets the reason. */
int scanhead_open(const char *source, struct scanhead **out, char *err, size_t err_len);
/* The same, but tries again for up to timeout_ms while the source isn't there: a head that is not plugged in, a device
 * node without permissions yet. timeout_ms < 0: for ever. On USB the system's hot-plug events start the next try. A
 * wrong source ends the tries at once, except a "tty:", which may still appear. A signal ends the tries early. One try
 * to connect by TCP may take 10 s, also beyond timeout_ms or after a signal. err gets the reason of the last try. */
int scanhead_open_within(const char *source, int timeout_ms, struct scanhead **out, char *err, size_t err_len);
void scanhead_close(struct scanhead *sh); /* sh may be NULL */
/* Returns the text of the last error, empty after a command or a frame. It is the handle's, until the next call. */
const char *scanhead_error(const struct scanhead *sh);

/* Waits until the same head is there again, and goes on with it. To be called after SCANHEAD_ELOST,
 * SCANHEAD_ERESET or SCANHEAD_ECLOSED, once all frames that had come were taken. Counters and the hash are kept.
 * Descriptor and anchor are kept, too, unless the head has started again. Names of labels are kept until the head sends
 * others. A jump in the sequence shows how many frames were lost meanwhile. On USB the same head is the one with the
 * same ids and serial number. SCANHEAD_ESTATE for a file or "fd:N". Any other error: the head did not come back in
 * time, or a signal came; call again, or close. */
int scanhead_reattach(struct scanhead *sh, int timeout_ms);

/* A head that is on USB now. */
struct scanhead_usb_head {
    char source[192]; /* for scanhead_open: usb:vid:pid:serial */
    uint16_t vid, pid;
    char serial[128], maker[128], product[128]; /* printable; other characters, and backslashes, as \xNN */
    int bus, device;
    double speed_bit_s; /* 0: unknown */
    char problem[320];  /* why it can't be opened, for instance no permission; empty: it can */
};
/* Describes at most max heads on USB. Returns how many there are, or SCANHEAD_EIO with the reason in err (or NULL). */
int scanhead_list_usb(struct scanhead_usb_head *heads, int max, char *err, size_t err_len);

/* Sends one command line of 1 to 256 printable ASCII characters, without its line end, and waits for its reply line,
 * which comes without its line end, too. Another line gives SCANHEAD_EINPUT. Frames that arrive meanwhile are kept, and
 * scanhead_next() gives them later. At most 64 MiB of frames are kept; then the oldest are dropped and counted
 * (stats.dropped). A reply "ERR n,..." is returned as it is, with SCANHEAD_OK: the command was answered. Before the
 * first command on a "tty:" the library sends an empty line and *IDN?, and skips all reply lines up to the answer: the
 * terminal may have echoed the head's own bytes to the head. It does the same after a command without its reply. */
int scanhead_command(struct scanhead *sh, const char *command, char *reply, size_t reply_len, int timeout_ms);

enum scanhead_frame_type { /* as on the wire */
                           SCANHEAD_DESCRIPTOR = 1,
                           SCANHEAD_ANCHOR = 2,
                           SCANHEAD_POINTS = 3,
                           SCANHEAD_LINE_END = 4,
                           SCANHEAD_TELEMETRY = 5,
                           SCANHEAD_EVENT = 6,
                           SCANHEAD_SURFACES = 7,
                           SCANHEAD_POSES = 8,
                           SCANHEAD_ATTRIBUTES = 9,
                           SCANHEAD_EMITTER = 10,
                           SCANHEAD_COLOURS = 11,
                           SCANHEAD_WAVES = 12,
};
enum scanhead_frame_flags { SCANHEAD_REPEAT = 1, SCANHEAD_LOCAL = 2 };

enum scanhead_event_code {
    SCANHEAD_EV_STATE = 1,
    SCANHEAD_EV_SCAN_START = 2,
    SCANHEAD_EV_SCAN_END = 3,
    SCANHEAD_EV_OVERRUN = 4,
    SCANHEAD_EV_READER_LOST = 5,
    SCANHEAD_EV_CONTROL = 6,
    SCANHEAD_EV_ERROR = 7,
    SCANHEAD_EV_SETTINGS = 8,
    SCANHEAD_EV_POSE_LATE = 9,
    /* after the colon: the event's values */
    SCANHEAD_EV_PPS = 10,  /* a full second: UTC (s since 1970), device time of the edge (ns), GPS time (s) */
    SCANHEAD_EV_TIME = 11, /* before each repeated descriptor: 0, device time (ns), its GPS time (ns) */
    SCANHEAD_EV_SITE = 12, /* a station was moved (SITE:POSE): its number, warnings of the head about its place */
    SCANHEAD_EV_PTP = 13,  /* port or servo of the PTP follower changed: port + 256 * servo, device time (ns),
                            * grandmaster; the numbers are in drivers/protocol/EVENTS.md */
};

struct scanhead_frame {
    int type, flags;
    uint32_t seq;
    int64_t t_ns;           /* device time */
    const uint8_t *payload; /* valid until the next call on this handle */
    size_t payload_len;
    const uint8_t *raw; /* the frame as on the wire, header and payload; valid as payload is */
    size_t raw_len;
    /* for SCANHEAD_POINTS; for SCANHEAD_ATTRIBUTES, SCANHEAD_COLOURS and SCANHEAD_WAVES only scan_line, n_points (of
     * waves: windows) and pulse0 */
    uint32_t scan_frame, scan_line, n_points, n_pulses;
    uint64_t pulse0;
    int64_t scan_t0_ns, line_t0_ns; /* since the scan's start: of pulse0, of the line's first pulse */
    uint32_t event;                 /* of SCANHEAD_EVENT, as the next two: enum scanhead_event_code */
    uint64_t event_value[3];
    char event_text[96]; /* as on the wire: also control characters */
};

/* Gets the next frame, in order. Damaged, wrong, repeated and late frames are left out, see scanhead_on_notice.
 * SCANHEAD_EFORMAT: the stream has no frame, or begins with one of another version; then the next call goes on. */
int scanhead_next(struct scanhead *sh, struct scanhead_frame *frame, int timeout_ms);

/* Notices about a stream, one for each event. Losses are counted in two independent ways:
 *   By frame number: GAP, REPEATED, LATE, RESTARTED. Each frame that did not come in order is in one GAP, even if it
 *   comes later. Only a restart hides missing frames. The n of all GAPs add up to stats.seq_lost.
 *   By byte: BAD_PAYLOAD, BAD_BYTES, CUT. Each byte of no frame and no reply is in one; their n add up to bad_bytes.
 * A damaged frame is counted both ways: first its bytes, then its number, once the next frame shows the gap. */
enum scanhead_notice_kind {
    /* n frames are missing, from seq on. at_byte: of the frame that came instead. Where the head reports that the
     * reader was too slow (SCANHEAD_EV_READER_LOST), the head has left these frames out. */
    SCANHEAD_NOTICE_GAP = 1,
    /* A frame came again: its number, time, type and checksum equal those of one of the last 256 frames. The frame is
     * not handed out again. A LOCAL frame has no number; it is compared only with the frame before it. */
    SCANHEAD_NOTICE_REPEATED = 2,
    /* A frame that was missing came after newer ones. It is not handed out, and stays counted as lost. Only the last 64
     * gaps of at most 65536 frames are remembered. 256 late frames with consecutive numbers count as a restart. */
    SCANHEAD_NOTICE_LATE = 3,
    /* The sequence jumps back, and the frame is neither REPEATED nor LATE: the head started again, or this is another
     * recording. seq: the first number of the new sequence. The frame is handed out. How many are missing is not
     * known. */
    SCANHEAD_NOTICE_RESTARTED = 4,
    /* A frame with a correct header and a wrong payload: seq is its number, t_ns its time. n: its bytes up to the next
     * correct frame. Where bytes were lost, n is less than the frame's length field says. */
    SCANHEAD_NOTICE_BAD_PAYLOAD = 5,
    /* n bytes that belong to no frame or reply: garbage, a frame with a broken header, a broken reply, or replies
     * between these and the next frame. A whole run of such bytes is one notice, before the next frame or reply. */
    SCANHEAD_NOTICE_BAD_BYTES = 6,
    /* The connection or the recording ended within a frame or a reply, of which n bytes had come. seq: the frame's
     * number, if its header had come. */
    SCANHEAD_NOTICE_CUT = 7,
    /* The line that was just sent came back before its reply; it was passed over. n: its length. */
    SCANHEAD_NOTICE_ECHO = 8,
    /* A reply came that nobody waits for, after a command that was given up. n: its length. */
    SCANHEAD_NOTICE_LATE_REPLY = 9,
    /* A reply came that nobody waits for, and no command was given up: it came twice, or a terminal had kept it. */
    SCANHEAD_NOTICE_UNASKED = 10,
    /* The connection is over, and all that had come was taken. n: -SCANHEAD_ECLOSED, -SCANHEAD_ELOST or
     * -SCANHEAD_ERESET. A recording gives no such notice. */
    SCANHEAD_NOTICE_CLOSED = 11,
    /* scanhead_reattach has found the head again. */
    SCANHEAD_NOTICE_REATTACHED = 12,
    /* A whole frame, in order, has wrong contents or another version: `why` says more. It is not handed out. */
    SCANHEAD_NOTICE_REFUSED = 13,
};

#define SCANHEAD_NO_TIME INT64_MIN

struct scanhead_notice {
    enum scanhead_notice_kind kind;
    uint32_t seq;     /* of the frame that the kind names; else 0 */
    uint64_t at_byte; /* where it begins, in all bytes that this handle has received, over all its connections */
    uint64_t n;       /* as the kind says; 1 for one frame */
    int64_t t_ns;     /* device time of the frame concerned, else of the last whole frame before, or SCANHEAD_NO_TIME */
    const char *why;  /* REFUSED: a line of text, valid until fn returns; else NULL */
};

/* fn gets each notice, from within scanhead_next, scanhead_command and scanhead_reattach. A notice comes before the
 * frame that follows it in the stream. Frames that come while a command waits are kept for scanhead_next, and REFUSED
 * waits with them; at_byte of all other notices never falls. On this handle fn may only call scanhead_get_stats, which
 * already counts the notice. NULL, as at first: no function. Counters go on. */
void scanhead_on_notice(struct scanhead *sh, void (*fn)(void *ctx, const struct scanhead_notice *notice), void *ctx);
/* Returns the kind in lower case, such as "bad payload"; "?" for another number. */
const char *scanhead_notice_name(int kind);

enum { SCANHEAD_NO_LABEL = 0xffff };

struct scanhead_point {
    /* Geo: in the stream's CRS (geodetic: degrees of latitude, degrees of longitude within -180..180,
     * metres). Polar: in the head's frame SOCS, metres. NaN for an empty shot. */
    double x, y, z;
    double range_m;             /* NaN for an empty shot */
    double mirror_rad, pan_rad; /* encoders; NaN in the geo layout */
    double reflectance_db;      /* NaN where not modelled */
    int64_t t_ns;               /* firing time since the scan's start */
    uint8_t echo, echo_count;   /* 0, 0: shot without echo */
    uint16_t label;             /* surface, or SCANHEAD_NO_LABEL */
};

/* Decodes points of the frame that scanhead_next returned last: at most max, from the index `first`. Returns
 * how many, or SCANHEAD_ESTATE before the descriptor and the anchor of the stream have come. In the geo
 * layout range_m is the distance from the anchor, which is the station: in utm within the grid, in geodetic
 * coordinates straight through space on WGS 84. The distance is NaN where the head moves. */
int scanhead_points(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first,
                    struct scanhead_point *points, uint32_t max);

/* Where scanhead_columns() writes. A column that is NULL is not computed. */
struct scanhead_columns {
    double *x, *y, *z, *range_m, *mirror_rad, *pan_rad, *reflectance_db;
    int64_t *t_ns;
    uint16_t *label;
    uint8_t *echo, *echo_count;
};
/* Writes what scanhead_points() gives into columns: the same figures, bit for bit, in less time. Columns need room for
 * max figures each, and must not overlap. Returns the number of points written, or a negative error. */
int scanhead_columns(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first,
                     const struct scanhead_columns *to, uint32_t max);

struct scanhead_attribute {
    double amplitude_db; /* above the head's detection threshold; NaN: not modelled, or an empty shot */
    double width_ns;     /* of the echo, full at half maximum; 655.35: that or more; NaN: an empty shot */
};

/* Decodes attributes from the frame of SCANHEAD_ATTRIBUTES that scanhead_next returned last: at most max,
 * from the index `first`. Attribute i belongs to point i of the last frame of SCANHEAD_POINTS. Returns how
 * many, or SCANHEAD_ESTATE where they are not those of the last points, because frames were lost. */
int scanhead_attributes(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first,
                        struct scanhead_attribute *attributes, uint32_t max);
/* Returns 1: a frame of attributes follows each frame of points; 0: the head sends none; SCANHEAD_ESTATE before the
 * descriptor has come. */
int scanhead_has_attributes(const struct scanhead *sh);

/* A colour for each point, sRGB. The head's key output.colour says what it shows. A shot without echo is grey. */
struct scanhead_colour {
    uint8_t red, green, blue;
};
/* Decodes colours from a frame of SCANHEAD_COLOURS, as scanhead_attributes does attributes. The frame of colours comes
 * after the points, and after their attributes where the head sends both. */
int scanhead_colours(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first,
                     struct scanhead_colour *colours, uint32_t max);
/* Returns 1 if a frame of colours follows each frame of points; else as scanhead_has_attributes. */
int scanhead_has_colours(const struct scanhead *sh);

/* A head that finds echoes in waveforms reports how far the shape of each echo is from the pulse's, RMS over the echo's
 * amplitude. These deviations are in the frames of SCANHEAD_ATTRIBUTES, and decoded as scanhead_attributes does.
 * 65.535: that or more; 0 for an empty shot. */
int scanhead_deviations(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first, double *deviation,
                        uint32_t max);
/* Returns 1 if attributes have deviations; else as scanhead_has_attributes. */
int scanhead_has_deviations(const struct scanhead *sh);

/* Samples of a pulse's waveform. All windows of a pulse have one grid; sample 0 is taken when the pulse fires. */
struct scanhead_wave {
    uint64_t pulse;         /* its number in the scan */
    int64_t t_ns;           /* firing time since the scan's start */
    uint32_t first, n;      /* samples, by their number on the grid */
    const uint8_t *sample;  /* n counts of two bytes, little-endian; valid as the frame's payload is */
    double range_m, step_m; /* of the first sample; from one to the next */
    /* Polar layout: the beam's direction in the head's frame SOCS, of length one. Geo layout: the change of x, y and z
     * in the CRS along a metre of range. So range times direction leads to the sample, from the head (geo: anchor). */
    double direction[3];
    uint32_t sample_ps, bits; /* time between samples; bits of a count */
    double baseline;          /* the count without light */
    double count_signal;      /* of one count, in units of the detection threshold */
};
/* Decodes windows of the frame of SCANHEAD_WAVES that scanhead_next returned last: at most max, from the index `first`,
 * in order of pulse, then of range. Several such frames may follow a frame of points, after its attributes and colours;
 * none does where no window was kept. Returns how many, or SCANHEAD_ESTATE where the points were lost. */
int scanhead_waves(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first, struct scanhead_wave *waves,
                   uint32_t max);
/* Returns the signal of sample i < wave->n in units of the detection threshold, without the baseline. */
double scanhead_wave_signal(const struct scanhead_wave *wave, uint32_t i);
/* Returns the number of samples that found no room in the head, as a frame of SCANHEAD_WAVES says. SCANHEAD_EINPUT
 * for another type. */
int64_t scanhead_waves_lost(struct scanhead *sh, const struct scanhead_frame *frame);
/* Returns 1 if frames of waveforms follow the points; else as scanhead_has_attributes. */
int scanhead_has_waves(const struct scanhead *sh);

struct scanhead_line_end {
    uint32_t scan_frame, scan_line;
    uint64_t pulse0;          /* the line's first pulse in the scan */
    int64_t t0_ns, t1_ns;     /* since the scan's start: this line's first pulse, the next one's */
    uint32_t n_fired, n_cast; /* pulses of the whole sweep; those outside its blind part */
    uint32_t n_echoes;        /* echoes sent; this, n_crowded, n_faint and n_unfit are 0 where parts were lost */
    uint32_t mirror_count, pan_count; /* encoders at the line's last pulse */
    uint32_t status;                  /* bit 0: last line of a pan sweep; bit 1: the scan was stopped in this line */
    uint32_t n_crowded;               /* echoes left out, the weakest: a pulse had more than the head sends */
    uint32_t n_faint;                 /* hits that the head did not detect */
    uint32_t n_unfit;                 /* echoes too far for the stream's integers: sent as empty shots */
};
/* Decodes a frame of SCANHEAD_LINE_END. SCANHEAD_EINPUT for another type, SCANHEAD_EFORMAT for a wrong payload. */
int scanhead_line_end(struct scanhead *sh, const struct scanhead_frame *frame, struct scanhead_line_end *end);

/* Descriptor and anchor say this about the stream. Strings are the handle's, until its next call. */
struct scanhead_info {
    const char *idn, *profile;
    int geo;           /* 1: geo layout, 0: polar */
    int crs;           /* 0 local (scene frame), 1 ECEF, 2 UTM/UPS, 3 geodetic */
    int epsg;          /* 0 for local */
    int geoid_heights; /* 1: heights of UTM and geodetic points are above the geoid; 0: ellipsoidal */
    double anchor[3];  /* metres; geodetic: degrees, degrees, metres; moves along with a head on a trajectory */
    double scale_m;    /* the step of coordinates on the wire is at most this long on the ground */
    double scale[3];   /* units of the CRS per count */
    double lat_deg, lon_deg, height_m; /* the station on WGS 84, ellipsoidal height; 0 where no place is configured */
    double station_m[3];               /* the station in the scene frame */
    double rotation[9];                /* head's frame SOCS -> scene frame, row by row */
    double axes[9]; /* scene frame at the anchor -> axes of the CRS (geodetic: east, north, up), row by row */
    double prr_hz, lines_hz, pan_deg_s, range_min_m, range_max_m;
    uint32_t station, n_surfaces, frames, scan;
    int moving;   /* 1: the head moves; station_m and rotation do not say where it is, poses do */
    int stop;     /* 1: the station is a stop on a trajectory */
    double frame; /* of a stop: frame scalar of the trajectory; else 0 */
};
/* Fills in *info. SCANHEAD_ESTATE before descriptor and anchor have come. */
int scanhead_get_info(const struct scanhead *sh, struct scanhead_info *info);

/* How the pulses of a head are arranged. */
enum scanhead_emitter_kind {
    SCANHEAD_EMIT_LINE = 0,       /* a mirror sweeps lines, the pan turns; nothing else is set */
    SCANHEAD_EMIT_PLANAR = 1,     /* one plane, in steps; a line is a turn, from step 0 on */
    SCANHEAD_EMIT_BEAMS = 2,      /* a firing sequence of beams turns about the vertical; a line is a turn */
    SCANHEAD_EMIT_SPHERE = 3,     /* rings of one elevation each; a line is a ring, a scan frame has all of them */
    SCANHEAD_EMIT_DIRECTIONS = 4, /* a list of directions; a line is the whole list once */
};
struct scanhead_beam {
    double elevation_deg, azimuth_deg; /* azimuth: clockwise from where the head looks when it fires */
    uint32_t offset_ns;                /* firing time after the sequence's first */
};
enum { SCANHEAD_MAX_BEAMS = 128 };
struct scanhead_emitter {
    int kind;       /* enum scanhead_emitter_kind */
    uint32_t steps; /* pulses of a line; beams: 0 */
    /* planar: the first and the last step that are cast. planar and sphere: the step that looks along y */
    int first_step, last_step, front_step;
    int turn;       /* +1: clockwise seen from above, -1: the other way */
    uint32_t rings; /* sphere: how many rings a scan frame has */
    /* ring i has the elevation first_ring_deg + i ring_step_deg; ring_step_deg 0: one ring alone */
    double first_ring_deg, ring_step_deg;
    int echoes;                                /* echoes sent of a pulse: 0 all, 1 first, 2 last, 3 strongest */
    uint64_t sequence_ns_num, sequence_ns_den; /* beams: a firing sequence lasts num / den nanoseconds */
    uint32_t n_beams;                          /* pulse k of a scan is firing k mod n_beams */
    struct scanhead_beam beam[SCANHEAD_MAX_BEAMS];
};
/* Fills in *emitter, which holds for the points that follow. SCANHEAD_ESTATE before the descriptor has come. When
 * settings change within a scan, the head sends another emitter. */
int scanhead_get_emitter(const struct scanhead *sh, struct scanhead_emitter *emitter);

/* The place and attitude from which a moving head casts at a time. Between two poses of one frame of SCANHEAD_POSES it
 * moves along the straight line, and turns the shorter way about one fixed axis at constant rate (slerp). */
struct scanhead_pose {
    int64_t t_ns;         /* since the scan's start */
    double position_m[3]; /* scene frame */
    double quat[4];       /* w x y z: head's frame SOCS -> scene frame */
    double frame;         /* frame scalar of the trajectory */
    int flags;            /* enum scanhead_pose_flags; between two poses the flags of both hold */
};
enum scanhead_pose_flags {
    SCANHEAD_POSE_EXTRAPOLATED = 1, /* beyond the last pose that the head had been given */
    SCANHEAD_POSE_LATE = 2,         /* too long after the last pose: the head assumed that the platform stands */
    SCANHEAD_POSE_NONE = 4,         /* the head had been given none of that time or before */
};
/* Gets the pose at t_ns since the scan's start. The pose is known for the points that came last, and some seconds back.
 * SCANHEAD_ESTATE where the stream has not reported the pose, or the head stands still. */
int scanhead_pose(struct scanhead *sh, int64_t t_ns, struct scanhead_pose *pose);
/* Decodes poses of the frame of SCANHEAD_POSES that scanhead_next returned last: at most max, from the index `first`.
 * Returns how many. */
int scanhead_poses(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first, struct scanhead_pose *poses,
                   uint32_t max);
/* Takes points of the polar layout from the head's frame to the scene frame: x, y and z in place. Where the
 * head moves, each point goes with the pose of its own time. frame (may be NULL) gets the frame scalar of
 * each point; at a stop of the head, the stop's. Returns how many points had no pose, because frames were
 * lost; their coordinates and frame scalars are NaN. SCANHEAD_ESTATE for another layout. */
int scanhead_to_scene(struct scanhead *sh, struct scanhead_point *points, uint32_t n, double *frame);

/* Gets the GPS time of t_ns since the scan's start (scanhead_point.t_ns), in the adjusted standard form of LAS: seconds
 * since 1980-01-06T00:00:00Z without leap seconds, less 1e9. Add 1e9 and divide by 604800 for week and second of week.
 * The time is valid for frames up to the one that scanhead_next returned last. It counts from the last time of the
 * head's clock, which comes at the scan's start and each second (events SCAN_START, PPS, TIME). It is exact to the
 * nanosecond where the head's clock has no drift; a double of that size has steps of 0.06 us, and of 0.12 us from
 * September 2028 on. SCANHEAD_ESTATE where the head doesn't know the time, or before the time and the scan's start have
 * come. A head that knows the time sends it before the first points that can be decoded. */
int scanhead_gps_time(const struct scanhead *sh, int64_t t_ns, double *adjusted_standard_gps_time_s);
/* Does the same for n times, bit for bit, and faster where all times lie within one second. */
int scanhead_gps_times(const struct scanhead *sh, const int64_t *t_ns, uint32_t n,
                       double *adjusted_standard_gps_time_s);

/* Returns 1 and the two names of a label (the handle's, until its next call), or 0 when they have not come yet. */
int scanhead_surface(const struct scanhead *sh, uint32_t label, const char **object, const char **material);

struct scanhead_stats { /* over all connections of the handle */
    uint64_t bytes, frames, bad_payload, bad_bytes, seq_gaps, seq_lost;
    uint64_t dropped;     /* frames dropped here while waiting for a reply */
    uint64_t reader_lost; /* frames the head says it could not give us */
    uint64_t pulses_lost; /* pulses the head says it could not compute */
    /* How often each notice came. seq_gaps above counts restarts, too. frames counts neither repeated nor late ones. */
    uint64_t repeated, late, restarts, cuts, echoes, late_replies, unasked, closed, reattached;
    /* Frames of bad_payload that no gap shows: before the first whole frame, before a restart, and after the last whole
     * frame. So seq_lost + bad_unseen frames are known to be lost on the way. */
    uint64_t bad_unseen;
    uint64_t refused; /* frames with wrong contents or of another version; frames above counts them, too */
};
void scanhead_get_stats(const struct scanhead *sh, struct scanhead_stats *stats);

/* scanhead_hash_hex() gives the hash of the stream so far, as COUNTS.md defines stream_sha256: 64 hex digits and a NUL.
 * The hash begins with the frames after scanhead_hash_start(), and costs about a nanosecond per byte. */
void scanhead_hash_start(struct scanhead *sh);
void scanhead_hash_hex(const struct scanhead *sh, char hex[65]);

#ifdef __cplusplus
}
#endif
#endif
