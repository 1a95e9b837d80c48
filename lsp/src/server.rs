//! The handlers: each puts a message on the queue and, for a request, waits for its answer.

use std::sync::mpsc::{Sender, channel};

use tokio::io::{AsyncRead, AsyncWrite};
use tokio::sync::{mpsc, oneshot};
use tower_lsp::jsonrpc::{Error, Result};
use tower_lsp::ls_types as lsp;
use tower_lsp::{Client, LanguageServer, LspService, Server};

use crate::analysis::{Analysis, Message, Published};

struct Backend {
    queue: Sender<Message>,
}

impl Backend {
    fn new(client: Client) -> Backend {
        let (queue, inbox) = channel();
        let (publish, mut outbox) = mpsc::unbounded_channel::<Published>();
        std::thread::spawn(move || {
            Analysis::new().serve(&inbox, |p| {
                let _ = publish.send(p);
            });
        });
        tokio::spawn(async move {
            while let Some(p) = outbox.recv().await {
                client.publish_diagnostics(p.uri, p.diagnostics, None).await;
            }
        });
        Backend { queue }
    }

    fn tell(&self, message: Message) {
        // The thread lives as long as the server; when it is gone there is nobody left to tell.
        let _ = self.queue.send(message);
    }

    async fn ask<T: Send + 'static>(&self, question: impl FnOnce(&mut Analysis) -> T + Send + 'static) -> Result<T> {
        let (send, receive) = oneshot::channel();
        self.tell(Message::Ask(Box::new(move |a| {
            let _ = send.send(question(a));
        })));
        receive.await.map_err(|_| Error::internal_error())
    }
}

impl LanguageServer for Backend {
    async fn initialize(&self, params: lsp::InitializeParams) -> Result<lsp::InitializeResult> {
        let offered = params.capabilities.general.and_then(|g| g.position_encodings).unwrap_or_default();
        let utf8 = offered.contains(&lsp::PositionEncodingKind::UTF8);
        if utf8 {
            self.tell(Message::Ask(Box::new(Analysis::count_bytes)));
        }
        let encoding = if utf8 { lsp::PositionEncodingKind::UTF8 } else { lsp::PositionEncodingKind::UTF16 };
        Ok(lsp::InitializeResult {
            capabilities: lsp::ServerCapabilities {
                position_encoding: Some(encoding),
                text_document_sync: Some(lsp::TextDocumentSyncCapability::Kind(lsp::TextDocumentSyncKind::INCREMENTAL)),
                hover_provider: Some(lsp::HoverProviderCapability::Simple(true)),
                completion_provider: Some(lsp::CompletionOptions {
                    trigger_characters: Some(vec!["#".into(), "<".into()]),
                    ..lsp::CompletionOptions::default()
                }),
                document_symbol_provider: Some(lsp::OneOf::Left(true)),
                document_formatting_provider: Some(lsp::OneOf::Left(true)),
                folding_range_provider: Some(lsp::FoldingRangeProviderCapability::Simple(true)),
                ..lsp::ServerCapabilities::default()
            },
            server_info: Some(lsp::ServerInfo { name: "gcc-robot".into(), version: Some(env!("CARGO_PKG_VERSION").into()) }),
            ..lsp::InitializeResult::default()
        })
    }

    async fn shutdown(&self) -> Result<()> {
        Ok(())
    }

    async fn did_open(&self, p: lsp::DidOpenTextDocumentParams) {
        self.tell(Message::Open { uri: p.text_document.uri, text: p.text_document.text });
    }
    async fn did_change(&self, p: lsp::DidChangeTextDocumentParams) {
        self.tell(Message::Change { uri: p.text_document.uri, changes: p.content_changes });
    }
    async fn did_close(&self, p: lsp::DidCloseTextDocumentParams) {
        self.tell(Message::Close { uri: p.text_document.uri });
    }

    async fn hover(&self, p: lsp::HoverParams) -> Result<Option<lsp::Hover>> {
        let at = p.text_document_position_params;
        self.ask(move |a| a.hover(&at.text_document.uri, at.position)).await
    }
    async fn completion(&self, p: lsp::CompletionParams) -> Result<Option<lsp::CompletionResponse>> {
        let at = p.text_document_position;
        let items = self.ask(move |a| a.complete(&at.text_document.uri, at.position)).await?;
        Ok(Some(lsp::CompletionResponse::Array(items)))
    }
    async fn document_symbol(&self, p: lsp::DocumentSymbolParams) -> Result<Option<lsp::DocumentSymbolResponse>> {
        let symbols = self.ask(move |a| a.symbols(&p.text_document.uri)).await?;
        Ok(Some(lsp::DocumentSymbolResponse::Nested(symbols)))
    }
    async fn folding_range(&self, p: lsp::FoldingRangeParams) -> Result<Option<Vec<lsp::FoldingRange>>> {
        self.ask(move |a| a.folds(&p.text_document.uri)).await.map(Some)
    }
    async fn formatting(&self, p: lsp::DocumentFormattingParams) -> Result<Option<Vec<lsp::TextEdit>>> {
        self.ask(move |a| a.format(&p.text_document.uri)).await
    }
}

/// Serves one client on any pair of streams.
pub async fn serve(input: impl AsyncRead + Unpin, output: impl AsyncWrite) {
    let (service, socket) = LspService::new(Backend::new);
    Server::new(input, output, socket).serve(service).await;
}
