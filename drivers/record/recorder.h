/* SPDX-License-Identifier: MIT */
/* Recorders: stream frames go in, one file comes out. The file's ending decides its format.
 *
 * A format is a `const struct recorder_ops` in a file of this folder, and one row in the table in recorder.c. A
 * .ply that is a mesh has no row: recorder_shape chooses it. Formats may share a file (mesh.c). All formats
 * share the file that appears whole or not at all (outfile.h), the points and poses of the stream (track.h), and the
 * report of what was left out. A recorder's own struct begins with a struct recorder. One thread per recorder. */
#ifndef DRIVERS_RECORD_RECORDER_H
#define DRIVERS_RECORD_RECORDER_H

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "drivers/record/colour.h"
#include "drivers/record/outfile.h"
#include "drivers/record/repair.h"
#include "drivers/record/track.h"

/* Counts of the grids that are written: shots, and empty places filled up between them. */
struct recorder_padding {
    uint64_t n_shots, n_places;
};

/* Columns of .ply beside x, y and z. */
enum ply_column {
    PLY_RANGE = 1 << 0,
    PLY_REFLECTANCE = 1 << 1,
    PLY_TIME = 1 << 2,
    PLY_ECHO = 1 << 3, /* and echo_count */
    PLY_LABEL = 1 << 4,
    PLY_STATION = 1 << 5,
    PLY_FRAME = 1 << 6,      /* where there are frames */
    PLY_ATTRIBUTES = 1 << 7, /* where the head sends them */
    PLY_COLOUR = 1 << 8,     /* where there are colours */
    PLY_ALL = (1 << 9) - 1,
    PLY_FLOAT = 1 << 9,      /* no column: x, y, z and range as float */
    PLY_XYZ = 1 << 10,       /* no column: nothing else is asked for */
    PLY_DEVIATION = 1 << 11, /* no word for it: it comes with the attributes, where the head sends it */
};
extern const char *const ply_column_words[]; /* by bit; NULL at the end */
/* Reads such words with commas between them. "xyz" adds no column. Returns 0 if a word is not known, or comes
 * twice. */
int ply_columns_read(const char *text, unsigned *columns);

struct recorder_options {
    int ascii;                   /* PLY as text */
    int empty_shots;             /* keep shots without echo, where the format can */
    struct colour_choice colour; /* for formats that hold a colour */
    unsigned columns;            /* of .ply: enum ply_column; 0: all, in double */
    int scalar_names;            /* PLY's columns besides coordinates and colour are called scalar_NAME */
    uint32_t n_heads;            /* heads one after the other; a head that comes again counts again; 0 stands for 1 */
    int may_wait;  /* the stream waits for the recorder: large files are written past the system's cache (outfile.h) */
    int las_minor; /* LAS 1.2 or 1.4: 2 or 4; 0: 4 */
    int las_wdp;   /* waveforms of .las go to a .wdp beside it */
    int mesh;      /* .ply is a mesh of the scan's grid */
    double long_edge;     /* of meshes: leaves out triangles with an edge longer than so many mean edges; 0: none */
    double sparse_per_m2; /* > 0: .ply has points spread over the mesh, so many per square metre */
    uint64_t sparse_seed; /* of the random choice of these points */
    /* At the end this report gets warnings of what the format had no room for. The report's function stop can give up a
     * file that is being completed, which may take long. May be NULL; must live until close. */
    const struct sh_report *report;
    /* Files of one recording share the limit of empty places. NULL: a file alone; else it must live until close. */
    struct recorder_padding *padding;
};

/* A scan that will be recorded, as its configuration describes it. Places are in the stream's coordinates: the scene
 * frame, or the CRS. */
struct recorder_scan {
    uint32_t station;
    int moves, is_geo, in_degrees;
    double place_m[3]; /* of the head; in the geo layout the place of the anchor */
    double range_max_m, scale_m;
    double n_shots; /* at most; infinity: not known */
};

struct recorder {
    const struct recorder_ops *ops;
    struct recorder_options options;
    struct outfile file;
    struct track track; /* its messages name file.path */
    /* Some of what came is missing before the file's end, since a write failed, memory ran out, or work was stopped:
     * the file is not completed. Where a format refuses points or a scan, those before are whole; a format that leaves
     * something unfinished then sets it. */
    int has_failed;
    int is_refused; /* the format can't hold the first scan: no file is made */
};

/* A format. All functions but fits and repair get the recorder's own struct as rec. Each function may be NULL. Errors:
 * SH_E, with the text in err. */
struct recorder_ops {
    const char *ending;     /* ".ply" */
    int is_mesh;            /* 1: the file is a mesh of the scan's grid, or has points spread over it */
    size_t size;            /* of the recorder's own struct; after its struct recorder it begins zeroed */
    struct track_ops track; /* takes points in batches */
    /* Before the first scan: SH_EINPUT where the format can't hold a scan in one file with `first`. NULL: it holds
     * all. */
    int (*fits)(const char *path, const struct recorder_options *options, const struct recorder_scan *first,
                const struct recorder_scan *scan, struct sh_err *err);
    /* The file is open and empty. */
    int (*begin)(void *rec, struct sh_err *err);
    /* Takes each frame of the stream, in order. NULL: track_frame alone takes them. */
    int (*frame)(void *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err);
    /* All points have come: completes the file (counts in the header) and reports what the format had no room for. */
    int (*finish)(void *rec, struct sh_err *err);
    /* Called about once a second: writes to the disk what has come so far, so that a repair finds it there. NULL:
     * flushing the file is enough. */
    int (*save)(void *rec, struct sh_err *err);
    /* Frees what the recorder's own struct holds; also after begin has failed. */
    void (*release)(void *rec);
    /* Makes a whole file of an incomplete one (repair.h). SH_EFORMAT: the file is not of this format, or too short to
     * tell. NULL: the format is written in one piece at its end, so there is nothing to keep. */
    int (*repair)(struct repair *repair, struct sh_err *err);
};

/* Finds the format by the path's ending. NULL: there is none, and err has the list of known endings. */
const struct recorder_ops *recorder_find(const char *path, struct sh_err *err);

/* Returns the format that ops becomes with these options: a .ply may be a mesh. */
const struct recorder_ops *recorder_shape(const struct recorder_ops *ops, const struct recorder_options *options);

/* Opens path for writing. Nothing is written to path itself before close succeeds: the data go to a file
 * beside it (".part") that is renamed at the end. Options are copied. */
int recorder_open(const struct recorder_ops *ops, const char *path, const struct recorder_options *options,
                  struct recorder **rec, struct sh_err *err);
/* Sets other limits for the recorder's colours; to be called before its first frame. */
void recorder_set_limits(struct recorder *rec, double low, double high);
/* Takes each frame of the stream, in order, with the handle for information, points and surfaces. The handle must
 * live until close. Whole scans may come from different handles: heads in one scene, whose labels mean the same. */
int recorder_frame(struct recorder *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err);
/* Some of the stream did not come, or will not: the file is not completed at its close, as after a failed write. */
void recorder_set_failed(struct recorder *rec);
/* To be called about once a second: writes what waits in memory to the disk. */
int recorder_save(struct recorder *rec, struct sh_err *err);
/* Finishes the file, syncs and renames it; keep = 0: throws it away. rec is freed, also after a failure. After a
 * failure what reached the disk stays as PATH.part, if the format can be repaired; a note in the report says so. Where
 * the report's stop gave the file up, nothing stays. */
int recorder_close(struct recorder *rec, int keep, struct sh_err *err);

/* Warns of n things: "PATH: N WHAT". n 0: does nothing. For formats. */
void recorder_report(const struct recorder *rec, uint64_t n, const char *what);

#endif
