/* SPDX-License-Identifier: MIT */
/* The usbredir back end's own struct, for its files: the socket, requests, data. Private. */
#ifndef DRIVERS_USB_USBREDIR_PRIVATE_H
#define DRIVERS_USB_USBREDIR_PRIVATE_H

#include <sys/types.h>
#include <usbredirparser.h>

#include "drivers/socket/socket.h"
#include "drivers/usb/backend.h"
#include "drivers/usb/retry.h"

struct redir_transfer;

struct usbredir {
    struct usb_device *device;
    int listener, fd;              /* -1: none */
    struct usbredirparser *parser; /* NULL: no connection (yet) */
    int broken;                    /* to be ended */
    const char *why;               /* broken: what the guest did wrong; NULL: it is gone */
    int greeted;                   /* its hello has come */
    int unplugged;                 /* by an injected fault */
    struct usb_transfer *held;     /* requests that are answered later; each is the first member of a redir_request */
    uint32_t n_held;
    const struct usb_owner *owner; /* within handle() */
    int n_reads;                   /* within one call of handle */
    uint32_t n_pending;
    uint64_t n_bytes;
    struct redir_transfer *receiving[16]; /* by number of the interrupt IN endpoint */
    uint64_t next_id;                     /* of interrupt packets */
    int reserve;                          /* of the listener: socket_reserve() */
    struct usb_retry retry;               /* of a connection we make */
    struct socket_address peer;           /* where to */
    char path[256];                       /* to be removed; empty: none */
    dev_t path_device;                    /* the socket that we made there; another file may have its place by now */
    ino_t path_inode;
    char name[USB_BACKEND_NAME_MAX];
};

/* Marks the connection broken for a reason that the owner is to know. */
static inline void usbredir_break(struct usbredir *self, const char *why)
{
    self->broken = 1;
    self->why = why;
}

/* usbredir_requests.c */
void usbredir_take_requests(struct usbredirparser *parser);
/* Whether a packet came before the hello; the library passes on such packets. The connection is then marked broken. */
int usbredir_is_early(struct usbredir *self);

/* Gives the device to the guest, whose hello has come. */
void usbredir_plug(struct usbredir *self);
/* Answers requests whose time has come, until the owner's go_on (backend.h) returns 0. */
void usbredir_answer_slow(struct usbredir *self);
/* Cancels a request that is held. Returns 1: it is answered as cancelled; 0: none of that id is held. */
int usbredir_cancel_slow(struct usbredir *self, uint64_t id);
void usbredir_forget_slow(struct usbredir *self);

/* usbredir_data.c */
void usbredir_take_data(struct usbredirparser *parser);
/* This is the usb_complete of all transfers. */
void usbredir_on_complete(void *ctx, struct usb_transfer *transfer);

#endif
