/* SPDX-License-Identifier: MIT */
/* Links: how bytes of the head get to the world, and back. A link knows nothing of frames or protocols.
 *
 * A kind of link is one file of this folder with one `const struct link_ops`, whose members are the contract;
 * null.c is the skeleton for a new one, link.c has the list. A link has sessions: readers and commanders that
 * come and go. A pty or a file has one, TCP several, USB two (console and stream) or one. One thread owns a link and
 * makes all calls on it but endpoint(). Only poll() waits, except that open() may wait for names and connections,
 * write() of `file` for the disk, and fault() and close() for clients, for some seconds at most. */
#ifndef DRIVERS_LINK_LINK_H
#define DRIVERS_LINK_LINK_H

#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include "core/err.h"

enum { LINK_MAX_SESSIONS = 8, LINK_MAX_EVENTS = 2 * LINK_MAX_SESSIONS + 2 };

enum link_type { LINK_NULL, LINK_FILE, LINK_PTY, LINK_TCP, LINK_USB, LINK_UDP, LINK_WEB, LINK_FD, LINK_MEMORY };

/* Whether the paces fast and step wait for the readers of a link, so that these readers lose nothing. Readers of other
 * links lose frames as in real time. */
enum link_waits { LINK_WAITS_BY_TYPE /* all but web do */, LINK_WAITS_YES, LINK_WAITS_NO };

struct web_source;  /* web.h */
struct link_memory; /* memory.h */

struct link_spec {
    enum link_type type;
    char path[256];     /* file: where to write; pty: symlink to the slave, may be empty; usb: see below; fd: what
                           its endpoint is called */
    char address[64];   /* tcp, udp, web: numeric or name; empty: 127.0.0.1 */
    int port;           /* tcp, web: 0 lets the system choose; udp: the receiver's */
    char interface[32]; /* udp: its name; needed for broadcasts and multicast. Empty: the system chooses */
    char source[64];    /* udp: numeric address of this machine that packets come from; empty: the system chooses */
    int source_port;    /* udp: port that packets come from; 0: the system chooses */
    int usual_port;     /* udp: 1: another source_port will do where this one can't be had, with a notice; see udp.c */
    int ttl;            /* udp: of the packets; 0: 1 to a multicast group, else the system's */
    int max_sessions;   /* tcp, web: 1..LINK_MAX_SESSIONS */
    int baud;           /* pty: of the head's UART; clients with another rate get, and send, other bytes. 0: any rate */
    int protocol;       /* what its owner speaks on it; 0: the usual. Links don't look at it */
    int dialect;        /* of that protocol; 0: any. Links don't look at it either */
    int units;          /* 1: each write has one whole unit of the protocol (a telegram), or the rest of one */
    int brief; /* tcp: 1: clients come for one request. When all places are taken, the longest silent one makes room */
    /* The link's owner carries out the next three. Links don't look at them. */
    int waits;                    /* enum link_waits */
    int latency_ms;               /* in real time bytes may wait this long for others */
    int clean;                    /* 1: the link gets no injected faults */
    const struct web_source *web; /* web: what it serves beside the page; outlives the link. NULL: nothing */
    int fd;                       /* fd: a connected stream descriptor (socket pair), taken over */
    struct link_memory *memory;   /* memory: what it shares with its client (memory.h); outlives the link */
    /* usb: struct usb_backend_spec explains address, port, path, attach, retry_ms and udc. vid and pid are the vendor
     * id and the product id of the device, 0x0000 to 0xffff. */
    int backend; /* enum usb_backend_type */
    int speed;   /* enum usb_rate: the fastest the device can do */
    int attach, retry_ms, vid, pid;
    int personality; /* enum usb_personality_id: the device it shows itself as, apart from vid, pid and serial */
    char udc[64];
    char serial[64]; /* empty: no serial number string */
    int own_serial;  /* 1: serial is only the beginning of the number; drivers/usb/own_identity.h makes the rest */
    char whose[300]; /* own_serial: a text that is the same whenever this head is started; the rest depends on it */
};

enum link_event_kind {
    LINK_OPENED,   /* a session began: it will read, and may command */
    LINK_CLOSED,   /* the session is gone; what was queued for it is void; its number may be used again */
    LINK_READABLE, /* read() has something */
    LINK_WRITABLE, /* write() will take something; only for sessions in want_write */
    LINK_WOKEN,    /* wake_fd was signalled; poll has drained it (eventfd) */
    LINK_REFUSED,  /* a client was turned away: all sessions are taken, or no descriptor is left */
    LINK_NOTICE,   /* a message to the person who runs the head: the text is in peer */
    LINK_PLUGGED,  /* usb: a host has got the device, and will enumerate it once poll() is called again */
    LINK_SHUT,     /* tcp: the other side sends nothing more, and all of it was read; it may go on reading */
};

struct link_event {
    enum link_event_kind kind;
    int session;    /* 0..max_sessions-1 */
    char peer[200]; /* the other side's name, for the log; LINK_NOTICE: the message; file's LINK_CLOSED: the reason */
};

/* Faults that can be injected into a link. */
enum link_fault {
    LINK_FAULT_DISCONNECT,        /* ends the session at once; what was not taken by the other side is lost */
    LINK_FAULT_UNPLUG,            /* ends all sessions, and the endpoint is not there until LINK_FAULT_PLUG */
    LINK_FAULT_CABLE,             /* nothing comes in or goes out until LINK_FAULT_PLUG; sessions stay */
    LINK_FAULT_BUS_RESET,         /* usb: ends all sessions; the device stays configured */
    LINK_FAULT_ENDPOINT_STALL,    /* usb: the session's endpoint to the host is halted until the host clears it */
    LINK_FAULT_SHORT_PACKETS,     /* usb: each of the session's next n transfers ends early, in a short packet */
    LINK_FAULT_REFUSE,            /* ends the session before a byte went out; to be called at LINK_OPENED */
    LINK_FAULT_SLOW_ENUMERATION,  /* usb: until changed, each control request takes for_ms; at LINK_PLUGGED */
    LINK_FAULT_DESCRIPTOR_LENGTH, /* usb: until changed, the configuration claims n bytes too many; at LINK_PLUGGED */
    LINK_FAULT_PLUG,              /* ends UNPLUG and CABLE; n 1: also resets the connections that CABLE kept */
};
#define LINK_FAULT_BIT(fault) (UINT32_C(1) << (fault))

struct link_ops {
    const char *name;
    int datagrams; /* 1: the system adds a checksum to each write, so a damaged one never arrives */
    int messages;  /* 1: each write goes out as one message; the owner puts text or frames into it, not both */

    int stalls;   /* 1: write() may wait */
    int is_cheap; /* 1: write() makes no system call, so that nothing is gained by collecting bytes */

    uint32_t faults;                               /* what fault() can do: LINK_FAULT_BIT of each */
    uint32_t (*can)(const struct link_spec *spec); /* faults that a link of this spec can do; NULL: all */

    /* Opens as spec says. When it fails, nothing of it stays. The text of err names the endpoint. */
    int (*open)(const struct link_spec *spec, void **link, struct sh_err *err);

    /* The endpoint as a client would name it: "tty:/dev/pts/3", "tcp:127.0.0.1:40123", "file:/x/y". Any thread
     * may call it, while the link's thread makes other calls. */
    void (*endpoint)(const void *link, char *buf, size_t len);

    /* Largest number of bytes per second this link can carry. NULL where there is no fixed limit. */
    double (*capacity)(const void *link);

    /* Waits up to timeout_ms (-1: for ever) and fills in at most max events; returns how many, or a negative SH_E, with
     * the reason in errno: the link is over then. want_write: where bit s is set, LINK_WRITABLE is reported when
     * session s can take bytes. A session whose reader does not read must not make poll return at once. link_poll.h has
     * what the poll functions of all links need. */
    int (*poll)(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *events, int max);

    /* read and write don't block, except as said above. They return how many bytes were moved; 0: none now; SH_ECLOSED,
     * or SH_EIO from `file`: the session is gone (a LINK_CLOSED follows from poll). */
    ssize_t (*read)(void *link, int session, void *buf, size_t len);
    ssize_t (*write)(void *link, int session, const void *buf, size_t len);

    /* As write, but the client reads the bytes where they lie, so they stay there until the next poll. NULL: there is
     * only write. */
    ssize_t (*lend)(void *link, int session, const void *buf, size_t len);

    /* Number of writes that were taken and did not arrive, as far as the system reports it: refused, or without a
     * route. NULL: none. To be called by the link's thread, or after it has ended. */
    uint64_t (*refused)(const void *link);

    /* Bytes written to a session that its reader has not taken: closing the link loses them. More bytes may wait than
     * are counted: the system learns of the last ones a moment late, and counts only up to a limit. 0 also where it
     * can't be known. NULL: closing loses no byte, as long as the client goes on reading. */
    int (*unread)(void *link, int session);

    /* Ends a session from this side: what was written goes out, and a LINK_CLOSED follows from poll. NULL: sessions of
     * this link can't be ended. */
    void (*end)(void *link, int session);

    /* Injects a fault, as enum link_fault says. A LINK_CLOSED follows for each session that ends by it. CABLE may wait
     * 200 ms for the peers' confirmations. Returns 0, or SH_ESTATE when it can't be done now (PLUG: somebody else has
     * the endpoint). NULL where `faults` is 0. */
    int (*fault)(void *link, enum link_fault what, int session, uint32_t n, double for_ms);

    /* Closes everything, removes what open made (symlink). link is void afterwards. */
    void (*close)(void *link);
};

/* From the one list of links, in link.c. NULL for an unknown type. */
const struct link_ops *link_ops_get(enum link_type type);
/* The faults that can be injected into a link of this spec: LINK_FAULT_BIT of each, without LINK_FAULT_PLUG. */
uint32_t link_faults(const struct link_spec *spec);

#endif
