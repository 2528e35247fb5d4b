"""The gpu layer: device, passes, timers, memory ledger, shader linking, parameters. Nothing else imports wgpu."""
